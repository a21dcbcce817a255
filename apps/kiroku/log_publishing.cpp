#include "apps/kiroku/log_publishing.h"

#include "archive/storage/file_system.h"
#include "base/error.h"
#include "base/number_text.h"
#include "witness/cosigning.h"
#include "witness/tiles.h"

namespace kiroku::apps {

using witness::Followed;
using witness::Following;

Publication publish_log(const Home& home, const std::filesystem::path& folder,
                        const std::function<void(std::uint64_t)>& progress) {
  const witness::LogToShow log = witness::read_log_to_show(home.log_folder(), home.device());
  return {follow_log(*witness::tiles_of(log), archive::real_file_system(), folder, {home.device()},
                     witness::KeepEvidence::kNo, progress),
          witness::words_of_rest(log), witness::is_rest_unsigned(log)};
}

std::string entries_text(const std::optional<crypto::Checkpoint>& checkpoint) {
  return counted(checkpoint ? checkpoint->size : 0, "entry", "entries");
}

std::string published_text(const Followed& followed, const std::string& folder) {
  switch (followed.what) {
    case Following::kBegun:
      return "published in " + folder + ": " + entries_text(followed.shown) +
             ", and nothing but their hashes";
    case Following::kSame:
      return "nothing came since: " + folder + " has the log's " + entries_text(followed.shown);
    case Following::kGoesOn:
      return "published in " + folder + ": " + entries_text(followed.shown) + ", " +
             std::to_string(followed.shown->size - followed.kept->size) + " of them new";
    case Following::kOlder:
      return "NOT PUBLISHED: " + folder + " has " + entries_text(followed.kept) +
             ", and this home's log has " + entries_text(followed.shown) +
             ": its end was removed, or this home is a copy from before";
    case Following::kTwoHistories:
      return "NOT PUBLISHED: " + folder + " has another history of this device's log, which is signed, too" +
             (followed.common
                  ? "; the first " + counted(*followed.common, "entry", "entries") + " are the same"
                  : "") +
             "; 'kiroku log compare' says more";
    case Following::kCouldNotTell:
      break;
  }
  return "NOT PUBLISHED: " + followed.why;
}

void LogPublishing::bring_up_to_date(std::vector<std::string>& problems) {
  if (!wanted_) return;
  if (const Clock::Time now = time_.now(); !next_ || now >= *next_) {
    next_ = now + kPause;
    problem_.clear();
    try {
      const Publication published = publish_log(home_, home_.published_log());
      if (!witness::is_up_to_date(published.came.what))
        problem_ = published_text(published.came, home_.published_log().string());
      else if (published.is_rest_unsigned)
        problem_ = "the log was not published to its end. " + published.rest.front();
      else
        next_ = now + kInterval;
    } catch (const Error& error) {
      problem_ = std::string("the log was not published: ") + error.what();
    }
  }
  if (!problem_.empty()) problems.push_back(problem_);
}

}  // namespace kiroku::apps

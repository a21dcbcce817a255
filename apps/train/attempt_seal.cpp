#include "apps/train/attempt_seal.h"

#include <algorithm>
#include <map>
#include <utility>

#include <nlohmann/json.hpp>

#include "apps/kiroku/case_recording.h"
#include "apps/kiroku/plan_seal.h"
#include "apps/kiroku/recording_setup.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "viewer/report/case_facts.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

/// By name, so that the same files give the same text.
ordered_json hashes_of(const fs::path& folder) {
  std::map<std::string, std::string> hashes;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_regular_file()) hashes[name] = crypto::to_hex(hashed("attempt", name, entry.path()).sha256);
  }
  return hashes;
}

/// As fast as they can be read: their times are their own.
std::string source_of(const fs::path& file) { return fs::absolute(file).string() + "?speed=max"; }

/// A case that took in its sources to their end.
constexpr const char* kWhole = "sources-ended";

}  // namespace

fs::path seal_attempt(const Home& home, const fs::path& folder, const std::string& film,
                      const ordered_json& facts, const std::string& summary,
                      const std::function<void(const std::string& case_id)>& begun) {
  const Configuration configuration = home.configuration();
  RecipientChoice recipients(home, configuration, {});
  recorder::SessionOptions options;
  options.archive = home.archive();
  options.device_name = home.device().name();
  options.event_recipients = recipients.of(kEventsRecipients);
  options.segment_duration = configuration.segment;
  options.stamp_interval = configuration.stamp_every;
  ordered_json training = facts;
  training["files"] = hashes_of(folder);
  const std::string subject = ordered_json{{"training", std::move(training)}}.dump();
  const ByteView bytes = bytes_of(subject);
  options.subject = Bytes(bytes.begin(), bytes.end());
  options.video.push_back({.name = "training",
                           .source = source_of(folder / film),
                           .purpose = "what the trainee saw",
                           .video = {},
                           .recipients = recipients.of("training")});
  options.vitals.push_back({.name = "forces",
                            .source = source_of(folder / kAttemptVitals),
                            .purpose = "forces and stress of the exercise",
                            .video = {},
                            .recipients = recipients.of("forces")});
  const recorder::SessionResult result =
      record_case(home, std::move(options), {}, [&](recorder::SessionOptions complete) {
        recorder::Session session(std::move(complete));
        try {
          if (begun) begun(session.case_id());
        } catch (...) {
          session.stop("not-sealed");
          session.run();
          throw;
        }
        session.mark(summary);
        return session.run();
      });
  const auto is_whole = [](const recorder::StreamStatus& stream) { return stream.dropped == 0; };
  if (result.close_reason != kWhole || !std::ranges::all_of(result.last.streams, is_whole)) {
    throw Error("the case " + result.folder.string() + " does not hold the whole attempt (" +
                result.close_reason + "); the files in " + folder.string() + " are whole");
  }
  return result.folder;
}

bool holds_whole_attempt(const fs::path& case_folder) {
  const report::CaseFacts facts = report::read_case_facts(case_folder);
  return facts.close_reason == kWhole && facts.gaps.empty();
}

}  // namespace kiroku::apps

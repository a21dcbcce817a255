#include "apps/kiroku/recording_setup.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "apps/common/command_line.h"
#include "apps/common/file.h"
#include "apps/kiroku/kept_log.h"
#include "archive/catalogue/catalogue.h"
#include "archive/storage/file_system.h"
#include "archive/writing/log_reading.h"
#include "base/error.h"
#include "crypto/encoding.h"

namespace kiroku::apps {

WritableHome::WritableHome(const Home& its_home, const TellWithout& without)
    : home(its_home),
      trust(home.trust(without)),
      queue(open_stamping_queue(home)),
      key(home.signing_key()),
      log(nullptr) {
  OpenedLog opened = open_kept_log(home, key);
  another_log = std::move(opened.why_another);
  log = std::move(opened.log);
  if (another_log.empty()) return;
  if (without) {
    without(another_log);
  } else {
    print_error("kiroku", "warning: " + another_log);
  }
}

RecipientChoice::RecipientChoice(const Home& home, const Configuration& configuration,
                                 const std::vector<std::string>& asked)
    : default_(load_recipients(home.recipients_file())) {
  for (const auto& [stream, file] : configuration.recipients) by_stream_[stream] = home.folder() / file;
  for (const std::string& text : asked) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0) {
      throw UsageError("--recipients-for is '" + text +
                       "': write STREAM=FILE, such as room=recipients-room.txt");
    }
    by_stream_[text.substr(0, equals)] = text.substr(equals + 1);
  }
}

crypto::AgeRecipients RecipientChoice::of(const std::string& stream) {
  used_.push_back(stream);
  const auto found = by_stream_.find(stream);
  return found == by_stream_.end() ? default_ : load_recipients(found->second);
}

void RecipientChoice::require_all_files() const {
  for (const auto& [stream, file] : by_stream_) static_cast<void>(load_recipients(file));
}

void RecipientChoice::require_all_used(const std::vector<std::string>& asked) const {
  for (const std::string& text : asked) {
    const std::string stream = text.substr(0, text.find('='));
    if (std::find(used_.begin(), used_.end(), stream) == used_.end()) {
      throw UsageError("--recipients-for names the stream '" + stream + "', which is not recorded here");
    }
  }
}

void log_configuration(const std::filesystem::path& file, const Home& home, archive::ApplianceLog& log,
                       const std::function<void(const std::string& sentence)>& tell) {
  const crypto::Sha256Digest digest = crypto::sha256(read_small_file(file, "the configuration"));
  std::string last;
  std::string damage =
      archive::for_each_readable_log_line(home.log_folder(), [&](const archive::LogLine& line) {
        if (line.type != "config-changed") return;
        const auto entry = nlohmann::json::parse(line.json, nullptr, false);
        if (entry.is_object()) last = entry.value("sha256", "");
      });
  if (!damage.empty()) {
    tell("the appliance log is damaged, or a newer version wrote it: " + damage +
         ". Cases are recorded, and entered behind it; but the log proves nothing from that line on, and "
         "nothing is erased or held. End the recorder and put that line back from a copy of the log (store, "
         "replica, backup), or install the newer version again; 'kiroku log --verify' tells more");
    last.clear();
  } else if (const std::string changed = log.damage(); !changed.empty()) {
    tell(changed + ". Cases are recorded, and entered behind it");
  }
  if (last != crypto::to_hex(digest)) log.config_changed(digest);
  for (const std::string& remark : log.remarks()) tell(remark);
}

std::shared_ptr<search::NoteWriter> search_notes_of(
    const Home& home, const Configuration& configuration,
    const std::function<void(const std::string& sentence)>& tell) {
  if (configuration.search.key.empty()) return {};
  const std::filesystem::path key = home.folder() / configuration.search.key;
  try {
    static_cast<void>(search::ApplianceKey::read(key));
  } catch (const Error& error) {
    tell(std::string("cases cannot be found by their patient or procedure: ") + error.what());
  }
  return std::make_shared<search::NoteWriter>(key, home.search_notes());
}

void refresh_catalogue(const Home& home, const std::filesystem::path& case_folder) {
  archive::Catalogue::open(home.catalogue_file())->refresh(case_folder);
}

std::shared_ptr<recorder::SourceGuard> guard_for(const Configuration& configuration,
                                                 recorder::SourceGuard::Tell tell) {
  recorder::SourceGuard::Limits limits;
  limits.silence = limits.ending = configuration.source_timeout;
  return std::make_shared<recorder::SourceGuard>(limits, std::move(tell));
}

}  // namespace kiroku::apps

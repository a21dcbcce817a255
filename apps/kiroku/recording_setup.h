// What every recording of a home needs, whether a person or a daemon starts it.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "apps/kiroku/authorities.h"
#include "apps/kiroku/home.h"
#include "archive/search/note_writer.h"
#include "archive/writing/appliance_log.h"
#include "crypto/age_recipient.h"
#include "recorder/source/source_guard.h"

namespace kiroku::apps {

/// A home whose archive is written to: what recording, recovery, retention and late time-stamps all need.
/// `home` must outlive it. What its members refer to stays; each is as thread-safe as its own header says.
struct WritableHome {
  /// Asks for the key's passphrase if it has one. Throws kiroku::Error where the key, the trusted roots or
  /// the appliance log cannot be used; of the queue, and of a log that is another one than the home knows, a
  /// warning says so. `without` as of Home::trust(); it hears of such a log, too.
  explicit WritableHome(const Home& its_home, const TellWithout& without = {});

  const Home& home;
  timestamp::TrustStore trust;
  std::unique_ptr<recorder::StampingQueue> queue;  // null: it cannot be used
  crypto::SigningKey key;
  std::string another_log;  // as why_another_log() says, when it was opened; nothing may be erased then
  std::unique_ptr<archive::ApplianceLog> log;
};

/// Recipients of each stream: the command line's, else kiroku.toml's, else recipients.txt.
class RecipientChoice {
 public:
  /// `asked` are STREAM=FILE of a command line. Throws kiroku::UsageError.
  RecipientChoice(const Home& home, const Configuration& configuration,
                  const std::vector<std::string>& asked);
  /// recipients.txt's.
  [[nodiscard]] const crypto::AgeRecipients& usual() const { return default_; }
  /// Also of kEventsRecipients and "pointing".
  [[nodiscard]] crypto::AgeRecipients of(const std::string& stream);
  /// Throws kiroku::Error for a file that is named and cannot be read, whether or not its stream is recorded.
  void require_all_files() const;
  /// What was asked for on the command line must be about a stream that of() was called for.
  void require_all_used(const std::vector<std::string>& asked) const;

 private:
  crypto::AgeRecipients default_;
  std::map<std::string, std::filesystem::path> by_stream_;
  std::vector<std::string> used_;
};

/// Enters the configuration's hash into the log where it is not the last one the log knows. A log of which a
/// line cannot be read keeps nobody from recording: `tell` hears which, and what to do.
void log_configuration(const std::filesystem::path& file, const Home& home, archive::ApplianceLog& log,
                       const std::function<void(const std::string& sentence)>& tell);

/// For one stream, with the limits of [recording]. `tell` is called from any thread.
std::shared_ptr<recorder::SourceGuard> guard_for(const Configuration& configuration,
                                                 recorder::SourceGuard::Tell tell);

/// What makes search notes; null where [search] of the configuration asks for none. A key that cannot be used
/// is told, and again with each case, which is recorded all the same.
std::shared_ptr<search::NoteWriter> search_notes_of(
    const Home& home, const Configuration& configuration,
    const std::function<void(const std::string& sentence)>& tell);

/// Brings one case of the catalogue up to date. Throws kiroku::Error; the case itself is not in question
/// then.
void refresh_catalogue(const Home& home, const std::filesystem::path& case_folder);

}  // namespace kiroku::apps

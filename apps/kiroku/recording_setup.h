// What every recording of a home needs, whether a person or a daemon starts it.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "apps/kiroku/home.h"
#include "crypto/age_recipient.h"

namespace kiroku::archive {
class ApplianceLog;
}

namespace kiroku::apps {

/// Recipients of each stream: the command line's, else kiroku.toml's, else recipients.txt.
class RecipientChoice {
 public:
  /// `asked` are STREAM=FILE of a command line. Throws kiroku::UsageError.
  RecipientChoice(const Home& home, const Configuration& configuration,
                  const std::vector<std::string>& asked);
  /// recipients.txt's.
  [[nodiscard]] const crypto::AgeRecipients& usual() const { return default_; }
  [[nodiscard]] crypto::AgeRecipients of(const std::string& stream);
  /// What was asked for on the command line must be about a stream that of() was called for.
  void require_all_used(const std::vector<std::string>& asked) const;

 private:
  crypto::AgeRecipients default_;
  std::map<std::string, std::filesystem::path> by_stream_;
  std::vector<std::string> used_;
};

/// Enters the configuration's hash into the log where it is not the last one the log knows.
void log_configuration(const std::filesystem::path& file, const Home& home, archive::ApplianceLog& log);

/// Brings one case of the catalogue up to date. Throws kiroku::Error; the case itself is not in question
/// then.
void refresh_catalogue(const Home& home, const std::filesystem::path& case_folder);

}  // namespace kiroku::apps

// The appliance's own ledger (docs/format.md, "The appliance log"): same lines, tree and checkpoints as a
// case. Thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "archive/ledger_entry.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

class FileSystem;

/// One line of the log for listing.
struct LogLine {
  std::uint64_t seq = 0;
  UtcTime utc;
  std::string type;
  std::string json;  // the exact line
};

class ApplianceLog {
 public:
  /// Opens or starts `<folder>/ledger.jsonl`. A torn last line (power cut) is cut off and stated. A second
  /// process on the same log is refused.
  static std::unique_ptr<ApplianceLog> open(FileSystem& files, const std::filesystem::path& folder,
                                            const crypto::SigningKey& key, const std::string& device_name);
  ~ApplianceLog();

  void boot(const std::string& boot_id);
  void shutdown();
  void config_changed(const crypto::Sha256Digest& sha256);
  void case_opened(const std::string& case_id, const crypto::Sha256Digest& entry0);
  void case_checkpoint(const std::string& case_id, std::uint64_t size, const crypto::Sha256Digest& root);
  void case_closed(const std::string& case_id, std::uint64_t size, const crypto::Sha256Digest& root,
                   const std::optional<crypto::Sha256Digest>& final_token);
  /// Who decrypted or exported what.
  void access(const std::string& case_id, const std::string& what, const std::string& who);
  [[nodiscard]] std::uint64_t size() const;
  [[nodiscard]] crypto::Sha256Digest root() const;
  /// Signs the present state into checkpoints/; done by the above at cases' ends and at shutdown.
  void checkpoint();

 private:
  struct State;
  explicit ApplianceLog(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// Reads a log without opening it for writing.
std::vector<LogLine> read_log(const std::filesystem::path& folder);

}  // namespace kiroku::archive

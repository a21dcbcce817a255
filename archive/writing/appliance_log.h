// The appliance's own ledger (docs/reference/format.md, "The appliance log"): same lines, tree and
// checkpoints as a case. Thread-safe. Several processes may have it open: each holds the file only while it
// appends, after reading what the others appended, so that an export can be logged while a recording runs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/format/ledger_entry.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

struct ConsentStatement;  // archive/format/log_entry.h
class FileSystem;

/// What the processes of one home tell each other of its log, where nobody who can write to the archive
/// writes. Each may be null. Both are called with the log's turn, and must neither throw nor call the log.
struct LogMemory {
  /// The note that `keep` was given last, in whichever process; nothing where none is known. It counts only
  /// where the device signed it, and for lines that it fits.
  std::function<std::optional<std::string>()> newest;
  /// Is given each note that was signed. It waits a moment at most.
  std::function<void(std::string_view note)> keep;
};

class ApplianceLog {
 public:
  /// How many entries there are, and the tree's root over them.
  struct Head {
    std::uint64_t size = 0;
    crypto::Sha256Digest root{};
  };

  /// Opens or starts `<folder>/ledger.jsonl`; the folder is made if its parent is there. A torn last line
  /// (power cut) is cut off, and a `recovered` entry states how many bytes it had. Lines behind the newest
  /// checkpoint of this device that no writer of it leaves are put aside, into log-aside/ beside the folder:
  /// an entry says so at once, and remarks(). So it is whenever something is appended. What a checkpoint
  /// covers that `memory` knows is never cut off: it is put back where somebody took it away. `files` and
  /// `key` must outlive the log. Throws kiroku::Error, also where the log states, in a line that this device
  /// signed, an ML-DSA key of the device that `key` does not have: what it signs would count for nothing. So
  /// do all that append. A key in hardware that it states, and `key` does not have, is silence as that of
  /// hardware which does not answer. `expected` is a checkpoint of the device's log that was kept elsewhere:
  /// see lacks().
  static std::unique_ptr<ApplianceLog> open(FileSystem& files, const std::filesystem::path& folder,
                                            const crypto::SigningKey& key, const std::string& device_name,
                                            const std::optional<crypto::Checkpoint>& expected = {},
                                            LogMemory memory = {});
  ~ApplianceLog();
  [[nodiscard]] const std::filesystem::path& folder() const;

  /// Why the lines that were there when the log was opened are not those that its newest checkpoint by this
  /// device is over, one sentence; "" where they are. The next entry states it in the log, so that what is
  /// signed from then on hides nothing.
  [[nodiscard]] std::string damage() const;
  /// What the lines that were there when the log was opened lack of the checkpoint that it was opened with,
  /// in words: "it has 5 entries", "its entries are others"; "" where they go on from it, or none was given.
  [[nodiscard]] std::string lacks() const;
  /// What was found so far of lines that this device did not sign, one sentence each.
  [[nodiscard]] std::vector<std::string> remarks() const;
  /// Has `tell` called with each of them from now on, and at once with those that remarks() did not return
  /// yet. It must neither throw, nor wait, nor call the log.
  void tell_of_remarks(std::function<void(const std::string& remark)> tell);

  // Each of these appends one entry durably; all but boot() and config_changed(), which the next one covers,
  // then sign a checkpoint. They throw kiroku::IoError and LedgerHeldError; after a
  // failed fsync the next one opens the log anew (ledger.h).

  /// States that the machine runs with this boot identifier; nothing if the newest `boot` states the same.
  /// Every other entry makes sure of it by itself, with the kernel's boot_id unless boot() was called, since
  /// mono_ns is only comparable within one boot. Once the log states an attestation key, the device's TPM is
  /// asked to quote the measured boot, which takes a bounded time; where it does not, the entry says why.
  void boot(const std::string& boot_id);
  void shutdown();
  void config_changed(const crypto::Sha256Digest& sha256);
  /// The key itself is the one given to open().
  void device_key_changed();
  /// The numbers of the entries that state keys beside Ed25519; nothing for one that none states.
  struct StatedKeys {
    std::optional<std::uint64_t> ml_dsa, hardware;
    /// The key by which the device's TPM quotes the boot.
    std::optional<std::uint64_t> attestation;
    std::string not_attested;  // why there is none though the key given to open() has one, else empty
  };
  /// States those of the key given to open() unless it is done, with a checkpoint by all keys. Every other
  /// entry makes sure of it by itself. kiroku::UsageError if the key has none; kiroku::Error, and nothing is
  /// written, if its hardware does not sign by the key that is to be stated. An attestation key that does not
  /// quote now is not stated, which is no error.
  StatedKeys state_keys();
  /// As this object last saw the log.
  [[nodiscard]] StatedKeys stated_keys() const;
  void plan_sealed(const crypto::Sha256Digest& sha256);
  void case_opened(const std::string& case_id, const crypto::Sha256Digest& entry0);
  void case_checkpoint(const std::string& case_id, std::uint64_t size, const crypto::Sha256Digest& root);
  void case_closed(const std::string& case_id, std::uint64_t size, const crypto::Sha256Digest& root,
                   const std::optional<crypto::Sha256Digest>& final_token);
  /// What was recorded ahead of a case that never began.
  void pre_roll_discarded(std::uint64_t segments, std::optional<std::int64_t> duration_ns);
  void replicated(const std::string& case_id, const std::string& target);
  /// One stream's segments by retention; without a stream, the whole case.
  void erased(const std::string& case_id, const std::optional<std::string>& stream,
              const std::string& policy);
  /// A legal hold of a case; the entry's number, by which case_released() names it.
  std::uint64_t case_held(const std::string& case_id, const std::string& reason, const std::string& who);
  void case_released(const std::string& case_id, std::uint64_t hold, const std::string& reason,
                     const std::string& who);
  /// A written consent, or that it was withdrawn; what it names lies in consents/ already. The entry's
  /// number.
  std::uint64_t consent_given(const ConsentStatement& statement);
  std::uint64_t consent_withdrawn(const ConsentStatement& statement);
  /// Who decrypted or exported what.
  void access(const std::string& case_id, const std::string& what, const std::string& who);
  /// The same for a purpose, to which a consent must stand.
  void access_for(const std::string& purpose, const std::string& case_id, const std::string& what,
                  const std::string& who);

  /// As this object last saw it; head() first takes in what other processes appended.
  [[nodiscard]] std::uint64_t size() const;
  [[nodiscard]] crypto::Sha256Digest root() const;
  [[nodiscard]] Head head() const;
  enum class CaseState { kUnknown, kOpened, kClosed };
  /// What the log says of a case, as this object last saw it.
  [[nodiscard]] CaseState case_state(const std::string& case_id) const;
  /// Has `keep` called with the note of the newest checkpoint by this device when the log was opened, and
  /// with each from now on, once it lies in checkpoints/ durably: somebody keeps it elsewhere. It must
  /// neither throw, nor wait, nor call the log: rooms' entries stand behind it.
  void keep_notes(std::function<void(std::string_view note)> keep);
  /// Signs the present state into checkpoints/, if no note of that size is there. Throws kiroku::Error where
  /// that would sign a statement which its own writer did not sign.
  void checkpoint();

 private:
  struct State;
  explicit ApplianceLog(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// The kernel's identifier of this boot of the machine; kUnknownBoot where it gives none.
std::string kernel_boot_id();
inline constexpr const char* kUnknownBoot = "unknown";

}  // namespace kiroku::archive

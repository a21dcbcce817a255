// Quotes of the measured boot in the appliance log, by docs/reference/format.md, "A boot that its TPM
// quotes". Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "archive/format/log_entry.h"
#include "archive/verify/finding_list.h"
#include "crypto/tpm_quote.h"

namespace kiroku::archive {

class BootRules {
 public:
  /// `log_itself`: else the log is read for a case, and only what was forged is told. `findings` must outlive
  /// the object.
  BootRules(FindingList& findings, bool log_itself) : findings_(&findings), log_itself_(log_itself) {}

  /// Whether the entry has a quote, so that take() needs the root before it.
  static bool quotes(const LogEntryBody& body);
  /// Each entry in its order. `root_before`: over the entries before it, where it has a quote; nothing where
  /// that is not known.
  void take(const LogEntryBody& body, std::uint64_t number,
            const std::optional<crypto::Sha256Digest>& root_before);
  /// After the last entry.
  void finish();

 private:
  struct Held {
    std::uint64_t entry = 0;
    std::string boot_id;
    crypto::TpmQuote said;
    std::vector<crypto::PcrValue> pcrs;
  };
  void take_boot(const BootEntry& boot, std::uint64_t number,
                 const std::optional<crypto::Sha256Digest>& root_before);
  void take_key(const DeviceAttestationEntry& added, std::uint64_t number,
                const std::optional<crypto::Sha256Digest>& root_before);
  void judge(const StatedQuote& stated, std::uint64_t number,
             const std::optional<crypto::Sha256Digest>& root_before);
  /// Against the quote before, which holds.
  void compare(const Held& now);
  /// A boot without a quote and without a word why.
  void take_unquoted(std::uint64_t number);
  /// Another key of the device: its attestation key is stated anew, if it has one.
  void forget_key();
  /// A finding of the entry `number`; one that tells of no forgery only where the log itself is judged.
  void add_forged(CodeName code, std::uint64_t number, const std::string& what);
  void add_of_log(CodeName code, std::uint64_t number, const std::string& text);

  FindingList* findings_;
  bool log_itself_;
  std::string device_, boot_id_;
  std::string key_text_;                       // as the log states it; empty: it states none
  std::optional<crypto::AttestationKey> key_;  // the same
  std::optional<Held> last_;
  std::uint64_t held_ = 0, silent_ = 0;  // quotes that hold, boots without one
  std::uint64_t last_silent_ = 0;
  std::string last_why_;
  std::uint64_t since_held_ = 0;  // entries of boots since the last quote that holds
  std::uint64_t further_resets_ = 0, last_further_ = 0;
  bool had_key_ = false;                                // the log stated an attestation key at some time
  std::uint64_t unmeasured_ = 0, last_unmeasured_ = 0;  // quotes that hold, of registers with nothing in them
  std::string last_empty_;                              // of that one, the registers
  std::uint64_t without_reset_ = 0, last_without_reset_ = 0;
};

}  // namespace kiroku::archive

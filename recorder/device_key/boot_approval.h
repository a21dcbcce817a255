// Files of a key that is sealed to approved states of the boot (crypto/boot_seal.h): what a machine says of
// its present state, and an approval of such a state. Neither is secret. A file may come from anywhere:
// reading is bounded, and an approval counts only where its signature and its device fit. Functions are
// thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "crypto/boot_seal.h"

namespace kiroku::recorder {

/// What whoever approves is given.
struct BootState {
  std::string device;  // the recorder's name, for people
  crypto::BootSeal seal;
  std::vector<crypto::PcrValue> pcrs;  // those of the seal

  [[nodiscard]] std::string to_json() const;
  /// Throws kiroku::Error naming what is wrong.
  static BootState parse(std::string_view json);
};

struct BootApproval {
  crypto::Sha256Digest tag{};  // as crypto::BootSeal
  std::vector<crypto::PcrValue> pcrs;
  Bytes signature;  // by the approver, DER

  [[nodiscard]] std::string to_json() const;
  /// Throws kiroku::Error naming what is wrong. The signature is not checked.
  static BootApproval parse(std::string_view json);
};

/// Signs this state; kiroku::Error where the device is sealed to another key.
BootApproval approve(const BootState& state, const crypto::ApprovalKey& key);
/// Why the approval does not count for a key with this seal, one sentence; empty if it does.
std::string why_no_approval(const BootApproval& approval, const crypto::BootSeal& seal);
/// What it is called in the folder: one name for one state, so that approving twice leaves one file.
std::string approval_file_name(const BootApproval& approval);

/// What lies in a folder of approvals.
struct BootApprovals {
  std::vector<BootApproval> counting;
  std::vector<std::string> problems;  // a sentence for each file that does not count
};
/// Those that count for the seal. A folder that is not there has none.
BootApprovals read_approvals(const std::filesystem::path& folder, const crypto::BootSeal& seal);

/// Registers in which the state differs from that approval which is nearest to it, ascending; empty where one
/// is of this very state. Nothing where there is no approval.
std::optional<std::vector<unsigned>> differing_registers(const std::vector<crypto::PcrValue>& state,
                                                         const std::vector<BootApproval>& approvals);

}  // namespace kiroku::recorder

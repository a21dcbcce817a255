// A key on P-256 in a TPM 2.0 (TCG TPM 2.0 Library, part 3), by tpm2-tss. It is a primary key of the owner's
// hierarchy: the TPM derives it anew from its own seed and the 32 bytes `unique`, which are no secret. So
// nothing of the private key is ever outside the TPM, not even wrapped. Clearing the TPM destroys it.
//
// Beside it stands an attestation key, derived from the same 32 bytes: a restricted one, which signs nothing
// but what the TPM itself says. It quotes the registers into which firmware and boot loaders measure what
// they start (TCG PC Client Platform Firmware Profile): of the SHA-256 bank 0 to 9, and 14 of shim. Others
// are left out since they go on changing while the machine runs, or with how far it has started.
//
// A sealed key signs only in a state of the boot that somebody approved (crypto/boot_seal.h): its template
// has the policy, so that the TPM itself asks, and the same 32 bytes without it make another key. The
// attestation key is never sealed: what another boot started must be told, too.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "crypto/boot_seal.h"
#include "crypto/hardware_key.h"
#include "crypto/tpm_quote.h"

namespace kiroku::recorder {

inline constexpr const char* kDefaultTcti = "device:/dev/tpmrm0";

// As the PC Client profile has them: 0 to 7 firmware, its settings, what it starts and Secure Boot's state;
// 8 and 9 what the boot loader reads, the kernel among it; 14 the keys of shim's owner.
inline constexpr std::array<unsigned, 11> kQuotedPcrs{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 14};

/// To what a key is sealed, and where approvals lie (recorder/device_key/boot_approval.h). They are read at
/// each signature, so that one that comes in counts from the next.
struct SealedTo {
  crypto::BootSeal seal;
  std::filesystem::path approvals;
};

/// Not thread-safe. Connects when it is first asked, and again after an error.
class TpmKey {
 public:
  /// `tcti` as tpm2-tss has it: "device:/dev/tpmrm0", "swtpm:host=127.0.0.1,port=2321".
  TpmKey(std::string tcti, Bytes unique, std::optional<SealedTo> sealed_to = {});
  ~TpmKey();
  TpmKey(TpmKey&&) noexcept;
  /// All of these throw kiroku::Error saying what the TPM, or the way to it, answered.
  crypto::P256PublicKey public_key();
  /// DER. A sealed key's error says whether the state of the boot is not approved, and which registers
  /// differ.
  Bytes sign(ByteView message);
  /// Of the SHA-256 bank, in the order asked for, which is ascending.
  std::vector<crypto::PcrValue> registers(const std::vector<unsigned>& pcrs);
  /// TPMT_PUBLIC of the attestation key.
  Bytes attestation_key();
  crypto::BootAttester::Quote quote(const crypto::Sha256Digest& qualifying_data);

 private:
  struct Connection;
  /// What `ask` gives; after an error the next one connects anew.
  template <typename Ask>
  auto with_connection(Ask ask);
  std::string tcti_;
  Bytes unique_;
  std::optional<SealedTo> sealed_to_;
  std::unique_ptr<Connection> connection_;
};

}  // namespace kiroku::recorder

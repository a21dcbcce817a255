// Where a device's key in hardware is: what device-hardware.json of a home says. It holds no secret.
// Functions are thread-safe.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "crypto/boot_seal.h"
#include "crypto/hardware_key.h"

namespace kiroku::recorder {

struct HardwareDescription {
  enum class Kind { kTpm, kPkcs11 };
  Kind kind = Kind::kTpm;
  std::string address;  // TCTI or PKCS#11 URI
  Bytes key;            // of a TPM the template's `unique`, of a token the key's CKA_ID
  crypto::P256PublicKey public_key;
  /// TPMT_PUBLIC of the TPM's attestation key; empty if it has none that this home uses, and for a token.
  Bytes attestation_key = {};
  /// To what states of the boot the TPM's key is sealed; nothing where it signs in any, and for a token.
  std::optional<crypto::BootSeal> seal = {};

  [[nodiscard]] std::string to_json() const;
  /// Throws kiroku::Error naming what is wrong.
  static HardwareDescription parse(std::string_view json);
};

/// Has the hardware make a new key; kiroku::Error where it does not.
HardwareDescription make_hardware_key(HardwareDescription::Kind kind, const std::string& address);
/// Registers to which a key is sealed unless others are wished: firmware (0) and that of added cards (2),
/// boot loader (4), state of Secure Boot (7), and what the boot loader reads: its commands, kernel, command
/// line and initial RAM disk (8, 9). Settings (1, 3), the list of disks (5) and what is the maker's own (6)
/// change without anybody starting other software.
inline const std::vector<unsigned> kUsualSealedPcrs{0, 2, 4, 7, 8, 9};
/// kiroku::UsageError for a register that no key can be sealed to: one that the quotes of the boot leave out
/// (recorder/device_key/tpm_key.h), as it changes while the machine runs, or can be set back. Likewise for a
/// list without register 4: whoever starts a boot loader of their own has it extend 8, 9 and 14 as they like.
void require_sealable(const std::vector<unsigned>& pcrs);
/// Has a TPM make one that is sealed to these registers, in states that `approver` approves. It signs nothing
/// before one is approved. kiroku::UsageError as require_sealable().
HardwareDescription make_sealed_key(const std::string& tcti, const crypto::P256PublicKey& approver,
                                    const std::vector<unsigned>& pcrs);
/// The values of registers of the SHA-256 bank, which are given in ascending order. Waits a bounded time;
/// kiroku::Error where the TPM does not answer, or has no such bank.
std::vector<crypto::PcrValue> read_registers(const std::string& tcti, const std::vector<unsigned>& pcrs);
/// The attestation key of the TPM that has this key; kiroku::Error where the TPM does not quote by it, or for
/// a token.
Bytes find_attestation_key(const HardwareDescription& description);
/// What signs by it, and quotes if there is an attestation key. Nothing is asked of the hardware before the
/// first signature. Of a sealed key `approvals` is the folder where approvals lie.
std::shared_ptr<const crypto::HardwareSigner> hardware_signer(const HardwareDescription& description,
                                                              const std::filesystem::path& approvals);

}  // namespace kiroku::recorder

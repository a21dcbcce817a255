// A key on P-256 in a TPM 2.0 (TCG TPM 2.0 Library, part 3), by tpm2-tss. It is a primary key of the owner's
// hierarchy: the TPM derives it anew from its own seed and the 32 bytes `unique`, which are no secret. So
// nothing of the private key is ever outside the TPM, not even wrapped. Clearing the TPM destroys it.
//
// Beside it stands an attestation key, derived from the same 32 bytes: a restricted one, which signs nothing
// but what the TPM itself says. It quotes the registers into which firmware and boot loaders measure what
// they start (TCG PC Client Platform Firmware Profile): of the SHA-256 bank 0 to 9, and 14 of shim. Others
// are left out since they go on changing while the machine runs, or with how far it has started.
#pragma once

#include <memory>
#include <string>

#include "crypto/hardware_key.h"
#include "crypto/tpm_quote.h"

namespace kiroku::recorder {

inline constexpr const char* kDefaultTcti = "device:/dev/tpmrm0";

/// Not thread-safe. Connects when it is first asked, and again after an error.
class TpmKey {
 public:
  /// `tcti` as tpm2-tss has it: "device:/dev/tpmrm0", "swtpm:host=127.0.0.1,port=2321".
  TpmKey(std::string tcti, Bytes unique);
  ~TpmKey();
  TpmKey(TpmKey&&) noexcept;
  /// All of these throw kiroku::Error saying what the TPM, or the way to it, answered.
  crypto::P256PublicKey public_key();
  /// DER.
  Bytes sign(ByteView message);
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
  std::unique_ptr<Connection> connection_;
};

}  // namespace kiroku::recorder

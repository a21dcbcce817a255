// The policy that lets a TPM 2.0 use a key only in a state of the measured boot that somebody approved:
// TPM2_PolicyAuthorize over TPM2_PolicyPCR (TCG TPM 2.0 Library, part 3; digests as part 1 defines them for
// policies), computed without a TPM. The key's own policy names who approves, and never a state: a state is
// approved later by a signature, so that an update of what is started costs no key. Pure functions,
// thread-safe.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/bytes.h"
#include "crypto/approval_key.h"
#include "crypto/hardware_key.h"
#include "crypto/hash.h"
#include "crypto/tpm_quote.h"

namespace kiroku::crypto {

/// What a key is sealed to.
struct BootSeal {
  P256PublicKey approver;      // whose signature approves a state
  std::vector<unsigned> pcrs;  // registers of the SHA-256 bank that make up a state; ascending, not empty
  /// Of the one key that is sealed: an approval for another does not fit. The policies' `policyRef`.
  Sha256Digest tag{};
};

/// The tag of the key whose template has these 32 bytes (recorder/device_key/tpm_key.h).
Sha256Digest boot_seal_tag(ByteView unique);

/// The first digits of the tag, by which people tell one sealed key from another.
std::string seal_name(const BootSeal& seal);

/// "0,2,4,7" as registers, ascending. Nothing, and one sentence in `problem`, for anything else.
std::optional<std::vector<unsigned>> parse_pcr_list(std::string_view text, std::string& problem);
/// "0,2,4,7".
std::string pcr_list(const std::vector<unsigned>& pcrs);

/// TPMT_PUBLIC of the approver's key as a TPM loads it to verify by (TPM2_LoadExternal). kiroku::Error for
/// what is no key on P-256.
Bytes approver_area(const P256PublicKey& approver);
/// TPM2B_NAME of that.
Bytes approver_name(const P256PublicKey& approver);
/// The sealed key's authPolicy.
Sha256Digest seal_policy(const BootSeal& seal);
/// The policy that such a state fulfils; the values stand in ascending order.
Sha256Digest state_policy(const std::vector<PcrValue>& state);
/// What the approver signs.
Bytes approval_message(const BootSeal& seal, const std::vector<PcrValue>& state);

/// r and s of a signature in DER, 32 bytes each, big endian; nothing where it is none on P-256.
std::optional<std::pair<Bytes, Bytes>> ecdsa_numbers(ByteView signature);

}  // namespace kiroku::crypto

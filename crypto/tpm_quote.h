// What a TPM 2.0 says of the measured boot by TPM2_Quote (TCG TPM 2.0 Library, part 2, TPMS_ATTEST and
// TPMT_PUBLIC; part 3, TPM2_Quote), read and checked without a TPM. Whoever wrote the bytes may be a forger:
// reading is bounded, and takes nothing but the one form that Kiroku's own keys give. Pure functions,
// thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "crypto/hardware_key.h"
#include "crypto/hash.h"

namespace kiroku::crypto {

/// Registers of a bank, as the PC Client profile has them.
inline constexpr unsigned kPcrs = 24;

/// A platform configuration register in the SHA-256 bank.
struct PcrValue {
  unsigned index = 0;
  Sha256Digest value{};
  friend bool operator==(const PcrValue&, const PcrValue&) = default;
};

/// A restricted signing key of a TPM: it signs what the TPM itself made, and nothing that it was given from
/// outside. Nobody but the TPM knows that the public area is that of a key in a TPM.
struct AttestationKey {
  P256PublicKey key;
  /// TPM2B_NAME of the key as the signer in a quote: its qualified name below the owner's hierarchy.
  Bytes qualified_name;
};
/// Of a TPMT_PUBLIC as TPM2_CreatePrimary gives it: P-256, ECDSA with SHA-256, restricted, made by the TPM,
/// which does not give it away. Nothing, and one sentence in `problem`, for anything else.
std::optional<AttestationKey> parse_attestation_key(ByteView public_area, std::string& problem);

/// A TPMS_ATTEST of a quote over registers of the SHA-256 bank.
struct TpmQuote {
  Bytes qualified_signer;
  Bytes qualifying_data;       // that the quote was asked for with
  std::uint64_t clock_ms = 0;  // how long the TPM had power since it was last cleared
  /// How often the TPM was reset, and restarted since. The TPM adds to each a number that belongs to the key
  /// (part 1, attestation by a key of the owner's hierarchy), modulo 2^32: differences alone mean anything.
  std::uint32_t resets = 0, restarts = 0;
  bool clock_is_safe = false;  // else a greater clock may have been given before, since power was lost
  std::vector<unsigned> pcrs;  // ascending
  Sha256Digest pcr_digest{};   // SHA-256 of their values, one after the other
};
/// Nothing, and one sentence in `problem`, for anything else.
std::optional<TpmQuote> parse_tpm_quote(ByteView attest, std::string& problem);

/// As a quote has it; the values stand in ascending order.
Sha256Digest digest_of_pcrs(const std::vector<PcrValue>& values);

/// What asks a TPM for quotes. Implementations are thread-safe.
class BootAttester {
 public:
  BootAttester() = default;
  BootAttester(const BootAttester&) = delete;
  BootAttester& operator=(const BootAttester&) = delete;
  virtual ~BootAttester() = default;
  /// TPMT_PUBLIC of the key that signs quotes. Known without asking the TPM.
  [[nodiscard]] virtual const Bytes& public_area() const = 0;
  struct Quote {
    Bytes attest;     // TPMS_ATTEST
    Bytes signature;  // by that key over SHA-256 of it, DER
    std::vector<PcrValue> pcrs;
  };
  struct Answer {
    std::optional<Quote> quote;
    std::string why;  // one sentence if there is none
  };
  /// Waits a bounded time, and never throws for what the TPM does.
  [[nodiscard]] virtual Answer quote(const Sha256Digest& qualifying_data) const = 0;
};

/// Why this is not a quote by the key with this public area, with these values and this qualifying data: the
/// question of whoever asked for it. Empty if it is.
std::string why_no_quote(const BootAttester::Quote& quote, ByteView public_area,
                         const Sha256Digest& qualifying_data);

}  // namespace kiroku::crypto

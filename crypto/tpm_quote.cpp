#include "crypto/tpm_quote.h"

#include <algorithm>

namespace kiroku::crypto {
namespace {

// Constants of part 2: TPM_GENERATED, TPM_ST, TPM_ALG_ID, TPM_ECC_CURVE, TPMA_OBJECT, TPM_HANDLE.
constexpr std::uint32_t kGenerated = 0xff544347;
constexpr std::uint16_t kAttestQuote = 0x8018;
constexpr std::uint16_t kSha256 = 0x000b, kNull = 0x0010, kEcdsa = 0x0018, kEcc = 0x0023;
constexpr std::uint16_t kNistP256 = 0x0003;
constexpr std::uint32_t kFixedTpm = 1U << 1U, kFixedParent = 1U << 4U, kSensitiveDataOrigin = 1U << 5U,
                        kRestricted = 1U << 16U, kDecrypt = 1U << 17U, kSign = 1U << 18U;
constexpr std::uint32_t kOwner = 0x40000001;
constexpr std::size_t kCoordinateSize = 32;
constexpr std::size_t kMostPolicyBytes = 64;
/// TPM2B_NAME holds an algorithm and a digest, TPM2B_DATA a digest and an algorithm: of SHA-512 at most.
constexpr std::size_t kMostDigestBytes = 66;

/// Takes numbers, big endian, and sized bytes from the front. What is not there is 0 or nothing, and the
/// cursor has failed from then on.
class Cursor {
 public:
  explicit Cursor(ByteView bytes) : rest_(bytes) {}

  template <typename Number>
  Number number() {
    const ByteView bytes = take(sizeof(Number));
    std::uint64_t value = 0;
    for (const std::byte each : bytes) value = value << 8U | std::to_integer<std::uint64_t>(each);
    return static_cast<Number>(value);
  }
  /// Bytes behind their number in two bytes, at most `most` of them.
  Bytes sized(std::size_t most) {
    const std::size_t size = number<std::uint16_t>();
    if (size > most) failed_ = true;
    return to_bytes(take(failed_ ? 0 : size));
  }
  ByteView take(std::size_t size) {
    if (failed_ || size > rest_.size()) {
      failed_ = true;
      return {};
    }
    const ByteView taken = rest_.first(size);
    rest_ = rest_.subspan(size);
    return taken;
  }
  [[nodiscard]] bool failed() const { return failed_; }
  /// All was there, and nothing follows.
  [[nodiscard]] bool at_end() const { return !failed_ && rest_.empty(); }

 private:
  ByteView rest_;
  bool failed_ = false;
};

template <typename Number>
void append_number(Bytes& bytes, Number number) {
  for (std::size_t i = sizeof(Number); i-- > 0;) bytes.push_back(static_cast<std::byte>(number >> (8 * i)));
}

/// The name of an entity (part 1, names): an algorithm and the digest.
Bytes name_of(ByteView content) {
  Bytes name;
  append_number(name, kSha256);
  append(name, sha256(content));
  return name;
}

}  // namespace

std::optional<AttestationKey> parse_attestation_key(ByteView public_area, std::string& problem) {
  const auto refuse = [&problem](const char* why) {
    problem = why;
    return std::nullopt;
  };
  Cursor cursor(public_area);
  const bool is_ecc = cursor.number<std::uint16_t>() == kEcc;
  const bool is_named_by_sha256 = cursor.number<std::uint16_t>() == kSha256;
  const auto attributes = cursor.number<std::uint32_t>();
  cursor.sized(kMostPolicyBytes);
  const bool has_no_cipher = cursor.number<std::uint16_t>() == kNull;
  const bool is_ecdsa = cursor.number<std::uint16_t>() == kEcdsa && cursor.number<std::uint16_t>() == kSha256;
  const bool is_p256 = cursor.number<std::uint16_t>() == kNistP256;
  const bool derives_no_key = cursor.number<std::uint16_t>() == kNull;
  const Bytes x = cursor.sized(kCoordinateSize);
  const Bytes y = cursor.sized(kCoordinateSize);
  if (!cursor.at_end()) return refuse("it is no TPMT_PUBLIC of a key on a curve");
  if (!is_ecc || !is_named_by_sha256 || !has_no_cipher || !is_ecdsa || !is_p256 || !derives_no_key)
    return refuse("it is no TPMT_PUBLIC of a key on P-256 that signs by ECDSA with SHA-256");
  constexpr std::uint32_t kNeeded = kFixedTpm | kFixedParent | kSensitiveDataOrigin | kRestricted | kSign;
  if ((attributes & kNeeded) != kNeeded || (attributes & kDecrypt) != 0)
    return refuse("by its attributes it is no restricted signing key that its TPM made and keeps");
  if (x.size() != kCoordinateSize || y.size() != kCoordinateSize)
    return refuse("a coordinate of it has not 32 bytes");
  std::optional<P256PublicKey> key = p256_point(x, y);
  if (!key) return refuse("it is no point of the curve P-256");
  Bytes below_owner;
  append_number(below_owner, kOwner);
  append(below_owner, name_of(public_area));
  return AttestationKey{std::move(*key), name_of(below_owner)};
}

std::optional<TpmQuote> parse_tpm_quote(ByteView attest, std::string& problem) {
  const auto refuse = [&problem](const char* why) {
    problem = why;
    return std::nullopt;
  };
  Cursor cursor(attest);
  const bool made_by_tpm = cursor.number<std::uint32_t>() == kGenerated;
  const bool is_quote = cursor.number<std::uint16_t>() == kAttestQuote;
  if (cursor.failed() || !made_by_tpm || !is_quote) return refuse("it is no TPMS_ATTEST of a quote");
  TpmQuote quote;
  quote.qualified_signer = cursor.sized(kMostDigestBytes);
  quote.qualifying_data = cursor.sized(kMostDigestBytes);
  quote.clock_ms = cursor.number<std::uint64_t>();
  quote.resets = cursor.number<std::uint32_t>();
  quote.restarts = cursor.number<std::uint32_t>();
  const auto safe = cursor.number<std::uint8_t>();  // TPMI_YES_NO
  quote.clock_is_safe = safe == 1;
  cursor.number<std::uint64_t>();  // the firmware's version, to which the TPM adds as to the counts
  const bool one_bank = cursor.number<std::uint32_t>() == 1 && cursor.number<std::uint16_t>() == kSha256;
  const std::size_t selected_bytes = cursor.number<std::uint8_t>();
  if (cursor.failed() || safe > 1) return refuse("it is cut short, or what is yes or no is neither");
  if (!one_bank || selected_bytes != kPcrs / 8)
    return refuse("it is not of 24 registers of the SHA-256 bank alone");
  for (std::size_t at = 0; at < selected_bytes; ++at) {
    const unsigned bits = cursor.number<std::uint8_t>();
    for (unsigned bit = 0; bit < 8; ++bit) {
      if ((bits >> bit & 1U) != 0) quote.pcrs.push_back(static_cast<unsigned>(8 * at) + bit);
    }
  }
  const Bytes digest = cursor.sized(sizeof(Sha256Digest));
  if (!cursor.at_end() || digest.size() != sizeof(Sha256Digest))
    return refuse("it does not end with a SHA-256 digest of registers");
  std::copy(digest.begin(), digest.end(), quote.pcr_digest.begin());
  return quote;
}

Sha256Digest digest_of_pcrs(const std::vector<PcrValue>& values) {
  Bytes all;
  for (const PcrValue& each : values) append(all, each.value);
  return sha256(all);
}

std::string why_no_quote(const BootAttester::Quote& quote, ByteView public_area,
                         const Sha256Digest& qualifying_data) {
  std::string problem;
  const auto key = parse_attestation_key(public_area, problem);
  if (!key) return "its key is none that attests: " + problem;
  const auto said = parse_tpm_quote(quote.attest, problem);
  if (!said) return "what it quotes cannot be read: " + problem;
  if (!verify_ecdsa_p256(key->key, quote.attest, quote.signature) ||
      said->qualified_signer != key->qualified_name)
    return "the quote is not by the key that it is known by";
  const bool was_asked = std::equal(said->qualifying_data.begin(), said->qualifying_data.end(),
                                    qualifying_data.begin(), qualifying_data.end());
  std::vector<unsigned> indices;
  for (const PcrValue& each : quote.pcrs) indices.push_back(each.index);
  if (!was_asked || said->pcrs != indices || said->pcr_digest != digest_of_pcrs(quote.pcrs))
    return "the quote is not of what was asked for";
  return {};
}

}  // namespace kiroku::crypto

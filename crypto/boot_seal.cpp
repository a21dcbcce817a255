#include "crypto/boot_seal.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <memory>

#include <openssl/bn.h>
#include <openssl/ec.h>
#include <openssl/ecdsa.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/openssl_handles.h"

namespace kiroku::crypto {
namespace {

using EcdsaSignature = std::unique_ptr<ECDSA_SIG, OpenSslDeleter<ECDSA_SIG_free>>;

// Constants of part 2: TPM_CC, TPM_ALG_ID, TPM_ECC_CURVE, TPMA_OBJECT.
constexpr std::uint32_t kPolicyAuthorize = 0x0000016a, kPolicyPcr = 0x0000017f;
constexpr std::uint16_t kSha256 = 0x000b, kNull = 0x0010, kEcdsa = 0x0018, kEcc = 0x0023;
constexpr std::uint16_t kNistP256 = 0x0003;
constexpr std::uint32_t kUserWithAuth = 1U << 6U, kSign = 1U << 18U;
constexpr std::size_t kCoordinateSize = 32;
constexpr std::uint8_t kSelectBytes = kPcrs / 8;

template <typename Number>
void append_number(Bytes& bytes, Number number) {
  for (std::size_t i = sizeof(Number); i-- > 0;) bytes.push_back(static_cast<std::byte>(number >> (8 * i)));
}

}  // namespace

Sha256Digest boot_seal_tag(ByteView unique) {
  Bytes text = to_bytes(std::string_view("kiroku/boot-seal\n"));
  append(text, unique);
  return sha256(text);
}

std::string seal_name(const BootSeal& seal) {
  constexpr std::size_t kDigits = 16;
  return to_hex(seal.tag).substr(0, kDigits);
}

std::optional<std::vector<unsigned>> parse_pcr_list(std::string_view text, std::string& problem) {
  std::vector<unsigned> pcrs;
  for (std::string_view rest = text;;) {
    const std::size_t comma = rest.find(',');
    const std::string_view one = rest.substr(0, comma);
    unsigned index = 0;
    const auto [end, failed] = std::from_chars(one.data(), one.data() + one.size(), index);
    if (failed != std::errc() || end != one.data() + one.size()) {
      problem = "'" + std::string(one) + "' is no number of a register: give numbers of 0 to " +
                std::to_string(kPcrs - 1) + " with commas between them, as in 0,2,4,7";
      return std::nullopt;
    }
    if (index >= kPcrs) {
      problem =
          "a TPM has the registers 0 to " + std::to_string(kPcrs - 1) + ", and no " + std::to_string(index);
      return std::nullopt;
    }
    if (std::find(pcrs.begin(), pcrs.end(), index) != pcrs.end()) {
      problem = "register " + std::to_string(index) + " is named twice";
      return std::nullopt;
    }
    pcrs.push_back(index);
    if (comma == std::string_view::npos) break;
    rest.remove_prefix(comma + 1);
  }
  std::sort(pcrs.begin(), pcrs.end());
  return pcrs;
}

std::string pcr_list(const std::vector<unsigned>& pcrs) {
  std::string text;
  for (const unsigned each : pcrs) text += (text.empty() ? "" : ",") + std::to_string(each);
  return text;
}

Bytes approver_area(const P256PublicKey& approver) {
  if (!is_p256_public_key(approver)) throw Error("an approval key that was given is no key on P-256");
  Bytes area;
  append_number(area, kEcc);
  append_number(area, kSha256);
  append_number(area, kUserWithAuth | kSign);
  append_number(area, std::uint16_t{0});  // no policy
  append_number(area, kNull);             // no symmetric algorithm
  append_number(area, kEcdsa);
  append_number(area, kSha256);
  append_number(area, kNistP256);
  append_number(area, kNull);  // no key derivation
  for (std::size_t i = 2; i > 0; --i) {
    append_number(area, static_cast<std::uint16_t>(kCoordinateSize));
    append(area, ByteView(approver).last(i * kCoordinateSize).first(kCoordinateSize));
  }
  return area;
}

Bytes approver_name(const P256PublicKey& approver) {
  Bytes name;
  append_number(name, kSha256);
  append(name, sha256(approver_area(approver)));
  return name;
}

Sha256Digest seal_policy(const BootSeal& seal) {
  Bytes first(sizeof(Sha256Digest));
  append_number(first, kPolicyAuthorize);
  append(first, approver_name(seal.approver));
  Bytes second = to_bytes(sha256(first));
  append(second, seal.tag);
  return sha256(second);
}

Sha256Digest state_policy(const std::vector<PcrValue>& state) {
  Bytes select(kSelectBytes);
  for (const PcrValue& each : state) {
    select.at(each.index / 8) |= static_cast<std::byte>(1U << each.index % 8);
  }
  Bytes text(sizeof(Sha256Digest));
  append_number(text, kPolicyPcr);
  append_number(text, std::uint32_t{1});
  append_number(text, kSha256);
  append_number(text, kSelectBytes);
  append(text, select);
  append(text, digest_of_pcrs(state));
  return sha256(text);
}

Bytes approval_message(const BootSeal& seal, const std::vector<PcrValue>& state) {
  Bytes message = to_bytes(state_policy(state));
  append(message, seal.tag);
  return message;
}

std::optional<std::pair<Bytes, Bytes>> ecdsa_numbers(ByteView signature) {
  const unsigned char* at = openssl_bytes(signature);
  const EcdsaSignature read(d2i_ECDSA_SIG(nullptr, &at, static_cast<long>(signature.size())));
  if (!read || at != openssl_bytes(signature) + signature.size()) {
    last_openssl_error();
    return std::nullopt;
  }
  std::pair<Bytes, Bytes> numbers{Bytes(kCoordinateSize), Bytes(kCoordinateSize)};
  const auto write = [](const BIGNUM* from, Bytes& to) {
    return BN_is_negative(from) == 0 &&
           BN_bn2binpad(from, openssl_bytes(std::span<std::byte>(to)), static_cast<int>(to.size())) >= 0;
  };
  if (!write(ECDSA_SIG_get0_r(read.get()), numbers.first) ||
      !write(ECDSA_SIG_get0_s(read.get()), numbers.second)) {
    last_openssl_error();
    return std::nullopt;
  }
  return numbers;
}

}  // namespace kiroku::crypto

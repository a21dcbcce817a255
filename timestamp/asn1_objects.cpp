#include "timestamp/asn1_objects.h"

#include <algorithm>
#include <array>
#include <utility>

#include <openssl/err.h>

#include "base/printable.h"
#include "timestamp/der.h"

namespace kiroku::timestamp {
namespace {

constexpr std::array kHashes{std::pair(NID_sha256, crypto::HashAlgorithm::kSha256),
                             std::pair(NID_sha384, crypto::HashAlgorithm::kSha384),
                             std::pair(NID_sha512, crypto::HashAlgorithm::kSha512),
                             std::pair(NID_sha3_256, crypto::HashAlgorithm::kSha3_256),
                             std::pair(NID_sha3_384, crypto::HashAlgorithm::kSha3_384),
                             std::pair(NID_sha3_512, crypto::HashAlgorithm::kSha3_512)};

std::string object_text(const ASN1_OBJECT* object, bool numbers_only) {
  std::array<char, 256> text{};
  const int length = OBJ_obj2txt(text.data(), int(text.size()), object, numbers_only ? 1 : 0);
  forget_openssl_errors();
  return length > 0 ? std::string(text.data()) : std::string("unreadable");
}

}  // namespace

std::string dotted(const ASN1_OBJECT* object) { return object_text(object, true); }

std::string name_of(const ASN1_OBJECT* object) { return object_text(object, false); }

std::string subject_of(const X509* certificate) {
  const BioHandle out(BIO_new(BIO_s_mem()));
  if (!out || X509_NAME_print_ex(out.get(), X509_get_subject_name(certificate), 0, XN_FLAG_RFC2253) < 0) {
    forget_openssl_errors();
    return "unreadable";
  }
  char* data = nullptr;
  const long size = BIO_get_mem_data(out.get(), &data);
  return size > 0 ? std::string(data, static_cast<std::size_t>(size)) : std::string();
}

Bytes integer_octets(const ASN1_INTEGER* number) {
  const Bytes der = encode_with<i2d_ASN1_INTEGER>(number);
  const auto element = sole_element(der, der::kInteger);
  if (!element) return {};
  ByteView octets = element->content;
  while (octets.size() > 1 && octets[0] == std::byte{0}) octets = octets.subspan(1);
  return to_bytes(octets);
}

std::optional<crypto::HashAlgorithm> hash_algorithm_of(const X509_ALGOR* identifier) {
  const ASN1_OBJECT* object = nullptr;
  int parameter_type = V_ASN1_UNDEF;
  X509_ALGOR_get0(&object, &parameter_type, nullptr, identifier);
  if (parameter_type != V_ASN1_UNDEF && parameter_type != V_ASN1_NULL) return {};
  const auto* known = std::find_if(kHashes.begin(), kHashes.end(),
                                   [&](const auto& hash) { return hash.first == OBJ_obj2nid(object); });
  if (known == kHashes.end()) return {};
  return known->second;
}

const EVP_MD* message_digest_of(crypto::HashAlgorithm algorithm) {
  switch (algorithm) {
    case crypto::HashAlgorithm::kSha224:
      return EVP_sha224();
    case crypto::HashAlgorithm::kSha256:
      return EVP_sha256();
    case crypto::HashAlgorithm::kSha384:
      return EVP_sha384();
    case crypto::HashAlgorithm::kSha512:
      return EVP_sha512();
    case crypto::HashAlgorithm::kSha3_256:
      return EVP_sha3_256();
    case crypto::HashAlgorithm::kSha3_384:
      return EVP_sha3_384();
    case crypto::HashAlgorithm::kSha3_512:
      return EVP_sha3_512();
  }
  return nullptr;
}

std::string printable(ByteView utf8) { return kiroku::printable(text_of(utf8)); }

void forget_openssl_errors() { ERR_clear_error(); }

}  // namespace kiroku::timestamp

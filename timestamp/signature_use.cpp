#include "timestamp/signature_use.h"

#include <algorithm>
#include <ctime>

namespace kiroku::timestamp {
namespace {

std::string key_name(const X509* certificate) {
  const EVP_PKEY* key = X509_get0_pubkey(certificate);
  switch (key == nullptr ? EVP_PKEY_NONE : EVP_PKEY_get_base_id(key)) {
    case EVP_PKEY_RSA:
    case EVP_PKEY_RSA_PSS:
      return "rsa";
    case EVP_PKEY_DSA:
      return "dsa";
    case EVP_PKEY_EC:
      return "ecdsa";
    case EVP_PKEY_ED25519:
      return "ed25519";
    case EVP_PKEY_ED448:
      return "ed448";
    default:
      break;
  }
  const char* name = key == nullptr ? nullptr : EVP_PKEY_get0_type_name(key);
  return name != nullptr ? name : "unreadable";
}

SignatureUse use_of(const X509* signer) {
  const EVP_PKEY* key = X509_get0_pubkey(signer);
  return {key_name(signer), key == nullptr ? 0 : EVP_PKEY_get_bits(key), {}};
}

/// "sha256" for those of crypto::hash_name(), else as OpenSSL calls it in lower case ("sha1"); empty for
/// none.
std::string hash_text(int number) {
  if (number == NID_undef) return {};
  for (const crypto::HashAlgorithm algorithm : crypto::kHashAlgorithms) {
    if (EVP_MD_get_type(message_digest_of(algorithm)) == number) {
      return std::string(crypto::hash_name(algorithm));
    }
  }
  const char* const name = OBJ_nid2sn(number);
  std::string text = name != nullptr ? name : "unknown";
  std::ranges::transform(text, text.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
  return text;
}

}  // namespace

std::vector<SignatureUse> signatures_on(crypto::HashAlgorithm token_hash,
                                        const std::vector<Certificate>& path) {
  std::vector<SignatureUse> uses{use_of(path.front().get())};
  uses.front().hash = crypto::hash_name(token_hash);
  for (std::size_t i = 0; i + 1 < path.size(); ++i) {
    SignatureUse use = use_of(path[i + 1].get());
    int hash = NID_undef;
    X509_get_signature_info(path[i].get(), &hash, nullptr, nullptr, nullptr);
    use.hash = hash_text(hash);
    uses.push_back(std::move(use));
  }
  forget_openssl_errors();
  return uses;
}

std::optional<UtcTime> end_of(const std::vector<Certificate>& path) {
  std::optional<UtcTime> end;
  for (const Certificate& certificate : path) {
    std::tm parts{};
    if (ASN1_TIME_to_tm(X509_get0_notAfter(certificate.get()), &parts) != 1) {
      forget_openssl_errors();
      return {};
    }
    const UtcTime here{std::chrono::seconds(::timegm(&parts))};
    end = end ? std::min(*end, here) : here;
  }
  return end;
}

}  // namespace kiroku::timestamp

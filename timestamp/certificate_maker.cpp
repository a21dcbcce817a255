#include "timestamp/certificate_maker.h"

#include <array>

#include <openssl/evp.h>

#include "base/error.h"
#include "crypto/secret.h"

namespace kiroku::timestamp {
namespace {

void require(bool done, const char* step) {
  if (!done) {
    throw Error(std::string("cannot make a certificate: ") + step + " failed (" +
                crypto::last_openssl_error() + ")");
  }
}

void add_name(X509_NAME* name, const char* field, const std::string& value) {
  const bool added =
      !value.empty() && X509_NAME_add_entry_by_txt(name, field, MBSTRING_UTF8, octets_of(bytes_of(value)),
                                                   int(value.size()), -1, 0) == 1;
  forget_openssl_errors();
  if (!added) {
    throw UsageError("cannot make a certificate for '" + value +
                     "': the name must be UTF-8 of 1 to 64 characters");
  }
}

void add_extension(X509* certificate, X509* issuer, int number, const char* value) {
  X509V3_CTX context{};
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const CertificateExtension extension(X509V3_EXT_conf_nid(nullptr, &context, number, value));
  require(extension && X509_add_ext(certificate, extension.get(), -1) == 1, "an extension");
}

void set_time(ASN1_TIME* field, UtcTime time) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(time).time_since_epoch().count();
  require(ASN1_TIME_adj(field, seconds, 0, 0) != nullptr, "the validity");
}

/// 159 random bits: unguessable, positive, and never 0 (RFC 5280 section 4.1.2.2).
void set_random_serial(X509* certificate) {
  std::array<std::byte, 20> random{};
  crypto::fill_random(random);
  random[0] = (random[0] & std::byte{0x7f}) | std::byte{0x40};
  const BigNumber number(BN_bin2bn(octets_of(random), int(random.size()), nullptr));
  require(number && BN_to_ASN1_INTEGER(number.get(), X509_get_serialNumber(certificate)) != nullptr,
          "the serial number");
}

/// `issuer` null: by the key itself, which is a private one then.
Certificate certificate_for(EVP_PKEY* key, const CertificateProfile& profile, const Credential* issuer) {
  Certificate made(X509_new());
  require(key != nullptr && made, "a new key");
  X509* certificate = made.get();
  X509* signer = issuer != nullptr ? issuer->certificate.get() : certificate;
  EVP_PKEY* signing_key = issuer != nullptr ? issuer->key.get() : key;

  require(X509_set_version(certificate, X509_VERSION_3) == 1, "the version");
  set_random_serial(certificate);
  set_time(X509_getm_notBefore(certificate), profile.not_before);
  set_time(X509_getm_notAfter(certificate), profile.not_after);
  X509_NAME* name = X509_get_subject_name(certificate);
  add_name(name, "O", profile.organisation);
  add_name(name, "CN", profile.common_name);
  require(X509_set_issuer_name(certificate, X509_get_subject_name(signer)) == 1, "the issuer");
  require(X509_set_pubkey(certificate, key) == 1, "the public key");

  const bool authority = profile.role == CertificateRole::kAuthority;
  add_extension(certificate, signer, NID_basic_constraints,
                authority ? "critical,CA:TRUE" : "critical,CA:FALSE");
  add_extension(certificate, signer, NID_key_usage,
                authority ? "critical,keyCertSign,cRLSign" : "critical,digitalSignature");
  add_extension(certificate, signer, NID_subject_key_identifier, "hash");
  if (issuer != nullptr) add_extension(certificate, signer, NID_authority_key_identifier, "keyid:always");
  if (!profile.extended_key_usage.empty()) {
    add_extension(certificate, signer, NID_ext_key_usage, profile.extended_key_usage.c_str());
  }
  if (!profile.alternative_names.empty()) {
    add_extension(certificate, signer, NID_subject_alt_name, profile.alternative_names.c_str());
  }
  require(X509_sign(certificate, signing_key, EVP_sha256()) > 0, "signing");
  return made;
}

}  // namespace

Credential issue_certificate(const CertificateProfile& profile, const Credential* issuer) {
  crypto::PrivateKey key(EVP_EC_gen("P-256"));
  Certificate certificate = certificate_for(key.get(), profile, issuer);
  return {std::move(key), std::move(certificate)};
}

Certificate issue_certificate_for(EVP_PKEY* key, const CertificateProfile& profile,
                                  const Credential& issuer) {
  return certificate_for(key, profile, &issuer);
}

}  // namespace kiroku::timestamp

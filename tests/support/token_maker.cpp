#include "tests/support/token_maker.h"

#include <array>
#include <stdexcept>

#include <openssl/pem.h>
#include <openssl/rsa.h>

#include "timestamp/der.h"

namespace kiroku::test {
namespace {

using namespace timestamp;  // NOLINT(google-build-using-namespace): the whole file speaks of it

void require(bool done, const char* step) {
  if (!done)
    throw std::runtime_error(std::string("token maker: ") + step + ": " + crypto::last_openssl_error());
}

Bytes info_of(const TokenRecipe& recipe) {
  const TsInfo info(TS_TST_INFO_new());
  const TsImprint imprint(TS_MSG_IMPRINT_new());
  const AlgorithmIdentifier algorithm(X509_ALGOR_new());
  X509_ALGOR_set0(algorithm.get(), OBJ_nid2obj(recipe.imprint_algorithm), V_ASN1_NULL, nullptr);
  Bytes hash = recipe.imprint;
  TS_MSG_IMPRINT_set_algo(imprint.get(), algorithm.get());
  TS_MSG_IMPRINT_set_msg(imprint.get(), reinterpret_cast<unsigned char*>(hash.data()), int(hash.size()));
  const Asn1Object policy(OBJ_txt2obj(recipe.policy.c_str(), 1));
  const Asn1Integer serial(ASN1_INTEGER_new());
  ASN1_INTEGER_set(serial.get(), 7);
  const std::unique_ptr<ASN1_GENERALIZEDTIME, OpenSslDeleter<ASN1_GENERALIZEDTIME_free>> time(
      ASN1_GENERALIZEDTIME_new());
  ASN1_STRING_set(time.get(), recipe.gen_time.data(), int(recipe.gen_time.size()));
  TS_TST_INFO_set_version(info.get(), recipe.version);
  TS_TST_INFO_set_policy_id(info.get(), policy.get());
  TS_TST_INFO_set_msg_imprint(info.get(), imprint.get());
  TS_TST_INFO_set_serial(info.get(), serial.get());
  TS_TST_INFO_set_time(info.get(), time.get());
  if (recipe.nonce) {
    const Asn1Integer nonce(ASN1_INTEGER_new());
    ASN1_INTEGER_set_uint64(nonce.get(), *recipe.nonce);
    TS_TST_INFO_set_nonce(info.get(), nonce.get());
  }
  if (recipe.critical_extension) {
    const Asn1Object name(OBJ_txt2obj("1.2.3.4.5", 1));
    const std::unique_ptr<ASN1_OCTET_STRING, OpenSslDeleter<ASN1_OCTET_STRING_free>> value(
        ASN1_OCTET_STRING_new());
    const CertificateExtension extension(X509_EXTENSION_create_by_OBJ(nullptr, name.get(), 1, value.get()));
    TS_TST_INFO_add_ext(info.get(), extension.get(), -1);
  }
  Bytes der = encode_with<i2d_TS_TST_INFO>(info.get());
  append(der, recipe.after_info);
  return der;
}

Bytes hash_of(const X509* certificate, const EVP_MD* algorithm) {
  Bytes hash(static_cast<std::size_t>(EVP_MD_get_size(algorithm)));
  unsigned int size = 0;
  X509_digest(certificate, algorithm, reinterpret_cast<unsigned char*>(hash.data()), &size);
  return hash;
}

/// SigningCertificate (SHA-1) or SigningCertificateV2 (SHA-256, the default, so unnamed): one entry.
Bytes signing_certificate(X509* identified, const EVP_MD* algorithm, X509* issuer_serial_of) {
  Bytes entry = der_value(der::kOctetString, {hash_of(identified, algorithm)});
  if (issuer_serial_of != nullptr) {
    const Bytes name = encode_with<i2d_X509_NAME>(X509_get_issuer_name(issuer_serial_of));
    const Bytes serial = encode_with<i2d_ASN1_INTEGER>(X509_get0_serialNumber(issuer_serial_of));
    const Bytes names = der_value(der::kSequence, {der_value(der::kContext4, {name})});
    append(entry, der_value(der::kSequence, {names, serial}));
  }
  return der_value(der::kSequence, {der_value(der::kSequence, {der_value(der::kSequence, {entry})})});
}

void add_signer(CMS_ContentInfo* cms, const TokenRecipe& recipe, const Credential& signer) {
  const unsigned int flags = CMS_PARTIAL | CMS_NOCERTS | CMS_NOSMIMECAP | CMS_BINARY |
                             (recipe.by_key_identifier ? CMS_USE_KEYID : 0U);
  CMS_SignerInfo* info =
      CMS_add1_signer(cms, signer.certificate.get(), signer.key.get(), recipe.digest, flags);
  require(info != nullptr, "signer");
  X509* identified = recipe.identified != nullptr ? recipe.identified : signer.certificate.get();
  const auto add = [&](int name, const EVP_MD* algorithm) {
    const Bytes value = signing_certificate(identified, algorithm, recipe.issuer_serial_of);
    require(CMS_signed_add1_attr_by_NID(info, name, V_ASN1_SEQUENCE, value.data(), int(value.size())) == 1,
            "attribute");
  };
  if (recipe.identify_v1) add(NID_id_smime_aa_signingCertificate, EVP_sha1());
  if (recipe.identify_v2) add(NID_id_smime_aa_signingCertificateV2, EVP_sha256());
}

}  // namespace

std::string pem_of(X509* certificate) {
  const BioHandle out(BIO_new(BIO_s_mem()));
  PEM_write_bio_X509(out.get(), certificate);
  char* data = nullptr;
  const long size = BIO_get_mem_data(out.get(), &data);
  return {data, static_cast<std::size_t>(size)};
}

std::string TestAuthority::root_pem() const { return pem_of(ca.certificate.get()); }

TestAuthority make_test_authority(const std::string& extended_key_usage) {
  const UtcTime from = *parse_utc("2020-01-01T00:00:00Z");
  const UtcTime to = *parse_utc("2040-01-01T00:00:00Z");
  TestAuthority out;
  out.ca = issue_certificate({.organisation = "Test",
                              .common_name = "Test root",
                              .role = CertificateRole::kAuthority,
                              .not_before = from,
                              .not_after = to,
                              .extended_key_usage = ""},
                             nullptr);
  out.signer = issue_certificate({.organisation = "Test",
                                  .common_name = "Test signer",
                                  .role = CertificateRole::kSigner,
                                  .not_before = from,
                                  .not_after = to,
                                  .extended_key_usage = extended_key_usage},
                                 &out.ca);
  return out;
}

Credential make_signer(const TestAuthority& authority, crypto::PrivateKey key) {
  Credential out{std::move(key), Certificate(X509_dup(authority.signer.certificate.get()))};
  require(X509_set_pubkey(out.certificate.get(), out.key.get()) == 1, "another key");
  require(X509_sign(out.certificate.get(), authority.ca.key.get(), EVP_sha256()) > 0, "signing anew");
  return out;
}

crypto::PrivateKey make_dear_key() {
  constexpr int kBits = 2048;
  constexpr int kExponentBits = 2000;
  const crypto::PrivateKeyContext context(EVP_PKEY_CTX_new_from_name(nullptr, "RSA", nullptr));
  const BigNumber exponent(BN_new());
  require(BN_set_bit(exponent.get(), kExponentBits) == 1 && BN_set_bit(exponent.get(), 0) == 1,
          "an exponent");
  EVP_PKEY* made = nullptr;
  require(EVP_PKEY_keygen_init(context.get()) == 1 &&
              EVP_PKEY_CTX_set_rsa_keygen_bits(context.get(), kBits) == 1 &&
              EVP_PKEY_CTX_set1_rsa_keygen_pubexp(context.get(), exponent.get()) == 1 &&
              EVP_PKEY_generate(context.get(), &made) == 1,
          "a dear key");
  return crypto::PrivateKey(made);
}

Bytes make_token(const TokenRecipe& recipe) {
  const unsigned int flags = CMS_PARTIAL | CMS_BINARY | CMS_NOCERTS | (recipe.detached ? CMS_DETACHED : 0U);
  const Bytes content = info_of(recipe);
  const BioHandle data(BIO_new_mem_buf(content.data(), int(content.size())));
  const CmsContent cms(CMS_sign(nullptr, nullptr, nullptr, data.get(), flags));
  require(cms && CMS_set1_eContentType(cms.get(), OBJ_nid2obj(recipe.content_type)) == 1, "content");
  add_signer(cms.get(), recipe, *recipe.signer);
  if (recipe.second_signer != nullptr) add_signer(cms.get(), recipe, *recipe.second_signer);
  for (X509* certificate : recipe.enclosed)
    require(CMS_add1_cert(cms.get(), certificate) == 1, "certificate");
  require(CMS_final(cms.get(), data.get(), nullptr, flags) == 1, "signing");
  return encode_with<i2d_CMS_ContentInfo>(cms.get());
}

Bytes make_response(ByteView token) {
  const std::array granted{std::byte{0}};
  const Bytes status = der_value(der::kSequence, {der_value(der::kInteger, {granted})});
  return der_value(der::kSequence, {status, token});
}

}  // namespace kiroku::test

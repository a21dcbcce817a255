#include "timestamp/signed_attributes.h"

#include <algorithm>
#include <array>

#include "timestamp/der.h"

namespace kiroku::timestamp {
namespace {

/// The hash function of an ESSCertIDv2; SHA-1 serves there as it does in version 1, to name a certificate
/// that the signature itself must then fit. NID_undef for others.
int identifying_hash(ByteView algorithm_identifier) {
  const auto algorithm = decode_with<AlgorithmIdentifier, d2i_X509_ALGOR>(algorithm_identifier);
  if (!algorithm) return NID_undef;
  const ASN1_OBJECT* object = nullptr;
  X509_ALGOR_get0(&object, nullptr, nullptr, algorithm.get());
  constexpr std::array kAccepted{NID_sha1,   NID_sha224,   NID_sha256,   NID_sha384,
                                 NID_sha512, NID_sha3_256, NID_sha3_384, NID_sha3_512};
  const int hash = OBJ_obj2nid(object);
  return std::find(kAccepted.begin(), kAccepted.end(), hash) == kAccepted.end() ? NID_undef : hash;
}

/// IssuerSerial ::= SEQUENCE { issuer GeneralNames (one directoryName), serialNumber INTEGER }
bool read_issuer_serial(ByteView content, CertificateIdentifier& identifier) {
  DerReader reader(content);
  const auto names = reader.next(der::kSequence);
  const auto serial = reader.next(der::kInteger);
  if (!names || !serial || !reader.at_end()) return false;
  const auto directory_name = sole_element(names->content, der::kContext4);
  if (!directory_name || !sole_element(directory_name->content, der::kSequence)) return false;
  identifier.issuer = to_bytes(directory_name->content);
  identifier.serial = to_bytes(serial->whole);
  return true;
}

enum class Version { k1, k2 };

/// SigningCertificate[V2] ::= SEQUENCE { certs SEQUENCE OF ESSCertID[v2], policies OPTIONAL }: its first
/// entry.
std::optional<CertificateIdentifier> read_signing_certificate(ByteView value, Version version) {
  const auto attribute = sole_element(value, der::kSequence);
  if (!attribute) return {};
  const auto certificates = DerReader(attribute->content).next(der::kSequence);
  if (!certificates) return {};
  const auto first = DerReader(certificates->content).next(der::kSequence);
  if (!first) return {};

  CertificateIdentifier identifier;
  identifier.hash = version == Version::k1 ? NID_sha1 : NID_sha256;
  DerReader reader(first->content);
  if (version == Version::k2) {
    if (const auto algorithm = reader.next(der::kSequence))
      identifier.hash = identifying_hash(algorithm->whole);
  }
  const auto hash = reader.next(der::kOctetString);
  if (!hash || identifier.hash == NID_undef) return {};
  identifier.certificate_hash = to_bytes(hash->content);
  if (const auto issuer_serial = reader.next(der::kSequence)) {
    if (!read_issuer_serial(issuer_serial->content, identifier)) return {};
  }
  if (!reader.at_end()) return {};
  return identifier;
}

struct AttributeName {
  int number;
  const char* text;
};
constexpr AttributeName kContentType{NID_pkcs9_contentType, "content-type"};
constexpr AttributeName kMessageDigest{NID_pkcs9_messageDigest, "message-digest"};
constexpr AttributeName kSigningCertificate{NID_id_smime_aa_signingCertificate, "signing-certificate"};
constexpr AttributeName kSigningCertificateV2{NID_id_smime_aa_signingCertificateV2, "signing-certificate-v2"};

/// The single value of an attribute that occurs at most once; `refusal` is set if it occurs twice or has not
/// one value.
const ASN1_TYPE* find_attribute(const CMS_SignerInfo* signer, const AttributeName& name,
                                std::optional<Refusal>& refusal) {
  const int at = CMS_signed_get_attr_by_NID(signer, name.number, -1);
  if (at < 0) return nullptr;
  X509_ATTRIBUTE* attribute = CMS_signed_get_attr(signer, at);
  if (CMS_signed_get_attr_by_NID(signer, name.number, at) >= 0 || X509_ATTRIBUTE_count(attribute) != 1) {
    refusal = Refusal{TokenCode::kMalformed, std::string("the token's signed attribute ") + name.text +
                                                 " does not occur exactly once"};
    return nullptr;
  }
  return X509_ATTRIBUTE_get0_type(attribute, 0);
}

Refusal malformed(const AttributeName& name) {
  return {TokenCode::kMalformed,
          std::string("the token's signed attribute ") + name.text + " is missing or malformed"};
}

}  // namespace

std::optional<SignedAttributes> read_signed_attributes(const CMS_SignerInfo* signer, Refusal& refusal) {
  std::optional<Refusal> doubled;
  const ASN1_TYPE* content_type = find_attribute(signer, kContentType, doubled);
  const ASN1_TYPE* digest = find_attribute(signer, kMessageDigest, doubled);
  const ASN1_TYPE* certificate = find_attribute(signer, kSigningCertificate, doubled);
  const ASN1_TYPE* certificate_v2 = find_attribute(signer, kSigningCertificateV2, doubled);
  forget_openssl_errors();
  if (doubled) {
    refusal = *doubled;
    return {};
  }
  if (content_type == nullptr || content_type->type != V_ASN1_OBJECT ||
      OBJ_obj2nid(content_type->value.object) != NID_id_smime_ct_TSTInfo) {
    refusal = malformed(kContentType);
    return {};
  }
  if (digest == nullptr || digest->type != V_ASN1_OCTET_STRING) {
    refusal = malformed(kMessageDigest);
    return {};
  }
  SignedAttributes out;
  out.message_digest = to_bytes(view_of(digest->value.octet_string));
  if (certificate == nullptr && certificate_v2 == nullptr) {
    refusal = {TokenCode::kSignerNotIdentified,
               "the token does not say which certificate signed it (no ESSCertID)"};
    return {};
  }
  const auto read = [&](const ASN1_TYPE* value, Version version, const AttributeName& name) {
    if (value == nullptr) return true;
    const auto identifier = value->type == V_ASN1_SEQUENCE
                                ? read_signing_certificate(view_of(value->value.sequence), version)
                                : std::nullopt;
    if (!identifier) {
      refusal = malformed(name);
      return false;
    }
    out.signer.push_back(*identifier);
    return true;
  };
  if (!read(certificate, Version::k1, kSigningCertificate) ||
      !read(certificate_v2, Version::k2, kSigningCertificateV2)) {
    return {};
  }
  return out;
}

bool fits(const CertificateIdentifier& identifier, const X509* certificate) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> hash{};
  unsigned int size = 0;
  if (X509_digest(certificate, EVP_get_digestbynid(identifier.hash), hash.data(), &size) != 1) {
    forget_openssl_errors();
    return false;
  }
  const ByteView digest = std::as_bytes(std::span(hash.data(), size));
  if (!std::equal(digest.begin(), digest.end(), identifier.certificate_hash.begin(),
                  identifier.certificate_hash.end())) {
    return false;
  }
  if (identifier.issuer.empty()) return true;
  const auto issuer = decode_with<CertificateName, d2i_X509_NAME>(identifier.issuer);
  const auto serial = decode_with<Asn1Integer, d2i_ASN1_INTEGER>(identifier.serial);
  return issuer && serial && X509_NAME_cmp(issuer.get(), X509_get_issuer_name(certificate)) == 0 &&
         ASN1_INTEGER_cmp(serial.get(), X509_get0_serialNumber(certificate)) == 0;
}

}  // namespace kiroku::timestamp

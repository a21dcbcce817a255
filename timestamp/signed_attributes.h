// The signed attributes that RFC 3161 section 2.4.2 and RFC 5816 demand of a token's only signer: what was
// signed, its digest, and by which certificate (ESSCertID of RFC 2634 section 5.4.1, ESSCertIDv2 of RFC
// 5035). Pure functions, thread-safe.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "timestamp/asn1_objects.h"
#include "timestamp/token_verifier.h"

namespace kiroku::timestamp {

/// One ESSCertID or ESSCertIDv2: the first of its attribute, which names the signer.
struct CertificateIdentifier {
  int hash = NID_undef;  // OpenSSL's number of the hash function
  Bytes certificate_hash;
  Bytes issuer;  // DER Name; empty where issuerSerial is absent
  Bytes serial;  // DER INTEGER; likewise
};

struct SignedAttributes {
  Bytes message_digest;
  /// One or two (real tokens carry both versions); the signer's certificate must fit all of them.
  std::vector<CertificateIdentifier> signer;
};

/// Why something is refused.
struct Refusal {
  TokenCode code = TokenCode::kMalformed;
  std::string explanation;
};

/// Reads the attributes: content-type (must be TSTInfo), message-digest, and at least one of the two
/// signing-certificate attributes, none of them twice. `refusal` says what is wrong when nothing is returned.
std::optional<SignedAttributes> read_signed_attributes(const CMS_SignerInfo* signer, Refusal& refusal);

/// Hash, and issuer and serial number where the identifier states them.
bool fits(const CertificateIdentifier& identifier, const X509* certificate);

}  // namespace kiroku::timestamp

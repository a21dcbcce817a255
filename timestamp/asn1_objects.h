// OpenSSL's ASN.1, X.509, CMS and TS objects as unique_ptr, and the small conversions that this folder
// shares. For .cpp files of this folder and its tests: the headers below are heavy. Pure functions,
// thread-safe.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include <openssl/bio.h>
#include <openssl/bn.h>
#include <openssl/cms.h>
#include <openssl/ts.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include "base/bytes.h"
#include "crypto/hash.h"
#include "crypto/openssl_handles.h"

namespace kiroku::timestamp {

using crypto::OpenSslDeleter;
using BioHandle = std::unique_ptr<BIO, OpenSslDeleter<BIO_free_all>>;
using BigNumber = std::unique_ptr<BIGNUM, OpenSslDeleter<BN_free>>;
using CmsContent = std::unique_ptr<CMS_ContentInfo, OpenSslDeleter<CMS_ContentInfo_free>>;
using Certificate = std::unique_ptr<X509, OpenSslDeleter<X509_free>>;
using CertificateStore = std::unique_ptr<X509_STORE, OpenSslDeleter<X509_STORE_free>>;
using CertificateStoreContext = std::unique_ptr<X509_STORE_CTX, OpenSslDeleter<X509_STORE_CTX_free>>;
using CertificateName = std::unique_ptr<X509_NAME, OpenSslDeleter<X509_NAME_free>>;
using CertificateExtension = std::unique_ptr<X509_EXTENSION, OpenSslDeleter<X509_EXTENSION_free>>;
using Asn1Integer = std::unique_ptr<ASN1_INTEGER, OpenSslDeleter<ASN1_INTEGER_free>>;
using Asn1Object = std::unique_ptr<ASN1_OBJECT, OpenSslDeleter<ASN1_OBJECT_free>>;
using Asn1Time = std::unique_ptr<ASN1_TIME, OpenSslDeleter<ASN1_TIME_free>>;
using AlgorithmIdentifier = std::unique_ptr<X509_ALGOR, OpenSslDeleter<X509_ALGOR_free>>;
using ExtendedKeyUsage = std::unique_ptr<EXTENDED_KEY_USAGE, OpenSslDeleter<EXTENDED_KEY_USAGE_free>>;
using TsRequest = std::unique_ptr<TS_REQ, OpenSslDeleter<TS_REQ_free>>;
using TsResponse = std::unique_ptr<TS_RESP, OpenSslDeleter<TS_RESP_free>>;
using TsResponseContext = std::unique_ptr<TS_RESP_CTX, OpenSslDeleter<TS_RESP_CTX_free>>;
using TsInfo = std::unique_ptr<TS_TST_INFO, OpenSslDeleter<TS_TST_INFO_free>>;
using TsImprint = std::unique_ptr<TS_MSG_IMPRINT, OpenSslDeleter<TS_MSG_IMPRINT_free>>;

/// A stack whose certificates belong to someone else.
struct BorrowedCertificatesDeleter {
  void operator()(STACK_OF(X509) * certificates) const { sk_X509_free(certificates); }
};
using BorrowedCertificates = std::unique_ptr<STACK_OF(X509), BorrowedCertificatesDeleter>;

/// A stack that holds a reference to each of its certificates.
struct OwnedCertificatesDeleter {
  void operator()(STACK_OF(X509) * certificates) const { sk_X509_pop_free(certificates, X509_free); }
};
using OwnedCertificates = std::unique_ptr<STACK_OF(X509), OwnedCertificatesDeleter>;

/// What OpenSSL's d2i functions take.
inline const unsigned char* octets_of(ByteView bytes) {
  return reinterpret_cast<const unsigned char*>(bytes.data());
}

/// The contents of any ASN1_STRING.
inline ByteView view_of(const ASN1_STRING* text) {
  return {reinterpret_cast<const std::byte*>(ASN1_STRING_get0_data(text)),
          static_cast<std::size_t>(ASN1_STRING_length(text))};
}

/// DER by one of OpenSSL's i2d functions; empty if it fails.
template <auto Encode, typename T>
Bytes encode_with(T* object) {
  const int size = Encode(object, nullptr);
  if (size <= 0) return {};
  Bytes der(static_cast<std::size_t>(size));
  auto* out = reinterpret_cast<unsigned char*>(der.data());
  Encode(object, &out);
  return der;
}

/// One of OpenSSL's d2i functions over all of `der`: nothing for malformed or trailing bytes. Leaves
/// OpenSSL's error queue empty.
template <typename Handle, auto Decode>
Handle decode_with(ByteView der);

/// "2.16.840.1.101.3.4.2.1"
std::string dotted(const ASN1_OBJECT* object);
/// "sha1" where OpenSSL knows a name, else dotted.
std::string name_of(const ASN1_OBJECT* object);
/// RFC 2253, ASCII only (everything else escaped, so that no name can play tricks on a terminal or report).
std::string subject_of(const X509* certificate);
/// Value octets without leading zero octets (a lone zero octet for 0): the number itself, unsigned and big
/// endian, where it is not negative; the two's complement otherwise.
Bytes integer_octets(const ASN1_INTEGER* number);
/// The hash algorithm named by an AlgorithmIdentifier without (or with NULL) parameters; nothing for others.
std::optional<crypto::HashAlgorithm> hash_algorithm_of(const X509_ALGOR* identifier);
const EVP_MD* message_digest_of(crypto::HashAlgorithm algorithm);
/// Text of a foreign response for our messages (base/printable.h).
std::string printable(ByteView utf8);

void forget_openssl_errors();

template <typename Handle, auto Decode>
Handle decode_with(ByteView der) {
  const unsigned char* at = octets_of(der);
  Handle object(Decode(nullptr, &at, static_cast<long>(der.size())));
  forget_openssl_errors();
  if (object && at != octets_of(der) + der.size()) object.reset();
  return object;
}

}  // namespace kiroku::timestamp

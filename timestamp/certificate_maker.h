// Issuing this project's own certificates (RFC 5280), of the embedded authority and the viewer: P-256 keys,
// ECDSA with SHA-256. For .cpp files. Functions are thread-safe.
#pragma once

#include <string>

#include "base/utc_time.h"
#include "timestamp/asn1_objects.h"

namespace kiroku::timestamp {

/// A private key and the certificate for it.
struct Credential {
  crypto::PrivateKey key;
  Certificate certificate;
};

enum class CertificateRole { kAuthority, kSigner };

/// What a new certificate says.
struct CertificateProfile {
  std::string organisation;  // 1 to 64 characters, UTF-8
  std::string common_name;   // likewise
  CertificateRole role = CertificateRole::kSigner;
  UtcTime not_before;
  UtcTime not_after;
  /// OpenSSL's notation, as "critical,timeStamping"; empty: no extended key usage.
  std::string extended_key_usage = {};
  /// Likewise, as "DNS:or-3,IP:127.0.0.1"; empty: none.
  std::string alternative_names = {};
};

/// A new key and its certificate with a random serial number, signed by `issuer` (null: by itself). Throws
/// kiroku::UsageError for names that do not fit, kiroku::Error if OpenSSL fails.
Credential issue_certificate(const CertificateProfile& profile, const Credential* issuer);
/// The same for a key that is somebody else's, as a request for a certificate has it.
Certificate issue_certificate_for(EVP_PKEY* key, const CertificateProfile& profile, const Credential& issuer);

}  // namespace kiroku::timestamp

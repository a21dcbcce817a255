// The signer's certificate and its path to a trusted one (RFC 5280 section 6, RFC 3161 section 2.3), judged
// at the time the token states. Revocation is not judged: no answer about it is asked for or read here.
// Thread-safe: the store is only read.
#pragma once

#include <optional>
#include <vector>

#include "base/utc_time.h"
#include "timestamp/asn1_objects.h"
#include "timestamp/signed_attributes.h"

namespace kiroku::timestamp {

/// What speaks against a certificate by itself: extended key usage that is not critical and timeStamping
/// alone, or a validity that does not include `time`.
std::optional<Refusal> check_signer_certificate(X509* signer, UtcTime time);

/// Signer first, trusted certificate last; empty when refused.
struct CertificatePath {
  std::vector<Certificate> certificates;
  std::optional<Refusal> refusal;
};

/// Builds and validates a path from `signer` to one of `trusted` (which `store` holds as well), with
/// `helpers` between. A path to a self-signed root is preferred; failing that, any trusted certificate ends
/// it, since experts hand over intermediates. A certificate among the helpers that only pretends to be part
/// of a path (same name and key identifier, other key) does not spoil it. Keys and hashes must give 112 bits
/// of security, and an intermediate that restricts its extended key usage must allow timeStamping.
CertificatePath validate_path(X509_STORE* store, const std::vector<Certificate>& trusted, X509* signer,
                              STACK_OF(X509) * helpers, UtcTime time);

}  // namespace kiroku::timestamp

// The signer's certificate and its path to a trusted one (RFC 5280 section 6, RFC 3161 section 2.3), judged
// at the time the token states. Revocation is not judged: no answer about it is asked for or read here.
// Thread-safe but for VerifiedSignatures: the store is only read.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <utility>
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
  /// Of a refused one: signatures lead to a trusted certificate all the same, and at another time such a path
  /// may hold.
  bool is_signed = false;
};

/// Which certificates were signed by which, and what became of paths, each verified once; and how much may
/// still be verified. Whoever holds the key of a trusted certificate can have others certify each other
/// without end, and a signature takes 0.1 ms. Holds pointers alone: whatever was asked about must outlive it.
/// Not thread-safe.
class VerifiedSignatures {
 public:
  using Path = std::vector<X509*>;  // signer first, trusted certificate last

  /// False also where nothing more may be verified.
  bool is_by(X509* certificate, X509* issuer);
  /// Why a path does not hold at this time, nothing where it does. `validate` is asked, and so many
  /// signatures are counted as the path has certificates, once for all times at which the same of them are
  /// valid. The outer nothing: no more may be verified.
  std::optional<std::optional<Refusal>> refusal_of(
      const Path& path, UtcTime time, const std::function<std::optional<Refusal>(const Path&)>& validate);
  /// Whether something was not verified for want of what is left.
  [[nodiscard]] bool is_spent() const { return is_spent_; }

 private:
  bool take(std::size_t signatures);

  static constexpr std::size_t kMost = 8192;
  std::size_t left_ = kMost;
  bool is_spent_ = false;
  std::map<std::pair<X509*, X509*>, bool> known_;
  std::map<std::pair<Path, std::vector<int>>, std::optional<Refusal>> refusals_;
};

/// Builds and validates a path from `signer` to one of `trusted` (which `store` holds as well), with
/// `helpers` between. A path to a self-signed root is preferred; failing that, any trusted certificate ends
/// it, since experts hand over intermediates. If one path holds, no other certificate spoils it, whether it
/// is trusted, lies among the helpers, or only pretends to be part of a path (same name and key identifier,
/// other key). Refused is what is refused on each path: where there are more than 32, or longer ones than of
/// 16 certificates, and none that was looked at holds, it is too dear. Keys and hashes must give 112 bits of
/// security, and an intermediate that restricts its extended key usage must allow timeStamping.
CertificatePath validate_path(X509_STORE* store, const std::vector<Certificate>& trusted, X509* signer,
                              STACK_OF(X509) * helpers, UtcTime time, VerifiedSignatures& verified);

}  // namespace kiroku::timestamp

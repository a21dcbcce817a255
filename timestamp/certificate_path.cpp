#include "timestamp/certificate_path.h"

#include <algorithm>
#include <ctime>
#include <deque>
#include <utility>

#include "base/error.h"

namespace kiroku::timestamp {
namespace {

/// OpenSSL's security level 2: RSA of 2048 bits, SHA-224 and better.
constexpr int kSecurityLevel = 2;

std::time_t seconds_of(UtcTime time) {
  return std::chrono::floor<std::chrono::seconds>(time).time_since_epoch().count();
}

bool is_valid_at(const X509* certificate, std::time_t time) {
  return X509_cmp_time(X509_get0_notBefore(certificate), &time) < 0 &&
         X509_cmp_time(X509_get0_notAfter(certificate), &time) > 0;
}

/// Whether extended key usage is absent, or lists timeStamping (or any purpose).
bool allows_time_stamping(const X509* certificate) {
  int critical = -1;
  const ExtendedKeyUsage usage(
      static_cast<EXTENDED_KEY_USAGE*>(X509_get_ext_d2i(certificate, NID_ext_key_usage, &critical, nullptr)));
  forget_openssl_errors();
  if (!usage) return critical == -1;  // -1: absent; others: malformed or doubled
  for (int i = 0; i < sk_ASN1_OBJECT_num(usage.get()); ++i) {
    const int purpose = OBJ_obj2nid(sk_ASN1_OBJECT_value(usage.get(), i));
    if (purpose == NID_time_stamp || purpose == NID_anyExtendedKeyUsage) return true;
  }
  return false;
}

TokenCode code_of(int error, int depth) {
  switch (error) {
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT:
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT_LOCALLY:
    case X509_V_ERR_UNABLE_TO_VERIFY_LEAF_SIGNATURE:
    case X509_V_ERR_SELF_SIGNED_CERT_IN_CHAIN:
    case X509_V_ERR_DEPTH_ZERO_SELF_SIGNED_CERT:
    case X509_V_ERR_CERT_UNTRUSTED:
      return TokenCode::kIssuerUnknown;
    case X509_V_ERR_CERT_NOT_YET_VALID:
    case X509_V_ERR_CERT_HAS_EXPIRED:
      return TokenCode::kCertificateNotValidAtTime;
    case X509_V_ERR_EE_KEY_TOO_SMALL:
    case X509_V_ERR_CA_KEY_TOO_SMALL:
    case X509_V_ERR_CA_MD_TOO_WEAK:
      return TokenCode::kWeakAlgorithm;
    case X509_V_ERR_INVALID_PURPOSE:
      return depth == 0 ? TokenCode::kNotATimeStampSigner : TokenCode::kChainInvalid;
    default:
      return TokenCode::kChainInvalid;
  }
}

/// Whether what failed is the validity of the certificate that was trusted, above at least one other.
bool is_validity_of_the_trusted(X509_STORE_CTX* context, TokenCode code) {
  const int depth = X509_STORE_CTX_get_error_depth(context);
  return code == TokenCode::kCertificateNotValidAtTime && depth > 0 &&
         depth == sk_X509_num(X509_STORE_CTX_get0_chain(context)) - 1;
}

Refusal root_not_valid(const std::string& who, UtcTime time) {
  return {TokenCode::kRootNotValidAtTime, "the trusted certificate " + who +
                                              " was not valid at the token's time, " + format_utc(time) +
                                              ": give the root that the authority had then"};
}

Refusal refusal_of(X509_STORE_CTX* context, UtcTime time) {
  const int error = X509_STORE_CTX_get_error(context);
  const TokenCode code = code_of(error, X509_STORE_CTX_get_error_depth(context));
  X509* const at = X509_STORE_CTX_get_current_cert(context);
  const std::string who = at != nullptr ? subject_of(at) : std::string("the signer");
  if (code == TokenCode::kIssuerUnknown) {
    return {code, "no path leads from " + who + " to a trusted root: give the authority's root and chain"};
  }
  // Authorities give a new root the old one's name. Without a key identifier nothing says which was meant.
  if (error == X509_V_ERR_CERT_SIGNATURE_FAILURE && at != nullptr &&
      X509_get0_authority_key_id(at) == nullptr) {
    return {TokenCode::kIssuerUnknown,
            "no certificate that was given signed that of " + who +
                ", though one has its issuer's name: give the authority's root and chain"};
  }
  if (is_validity_of_the_trusted(context, code)) return root_not_valid(who, time);
  return {code, "the certificate path does not hold at " + who + ": " + X509_verify_cert_error_string(error)};
}

CertificatePath validate(X509_STORE* trusted, X509* signer, STACK_OF(X509) * helpers, UtcTime time,
                         unsigned long flags) {
  const CertificateStoreContext context(X509_STORE_CTX_new());
  if (!context || X509_STORE_CTX_init(context.get(), trusted, signer, helpers) != 1) {
    throw Error("cannot start validating a certificate path: " + crypto::last_openssl_error());
  }
  X509_VERIFY_PARAM* parameters = X509_STORE_CTX_get0_param(context.get());
  X509_VERIFY_PARAM_set_time(parameters, seconds_of(time));
  X509_VERIFY_PARAM_set_purpose(parameters, X509_PURPOSE_TIMESTAMP_SIGN);
  X509_VERIFY_PARAM_set_auth_level(parameters, kSecurityLevel);
  X509_VERIFY_PARAM_set_flags(parameters, flags);
  const bool holds = X509_verify_cert(context.get()) == 1;
  forget_openssl_errors();
  CertificatePath out;
  if (!holds) {
    out.refusal = refusal_of(context.get(), time);
    return out;
  }
  STACK_OF(X509)* chain = X509_STORE_CTX_get0_chain(context.get());
  const int length = sk_X509_num(chain);
  for (int i = 0; i < length; ++i) {
    X509* certificate = sk_X509_value(chain, i);
    if (i > 0 && i < length - 1 && !allows_time_stamping(certificate)) {
      out.refusal = Refusal{TokenCode::kChainInvalid, "the intermediate " + subject_of(certificate) +
                                                          " may not issue time-stamping certificates"};
      out.certificates.clear();
      return out;
    }
    X509_up_ref(certificate);
    out.certificates.emplace_back(certificate);
  }
  return out;
}

/// Paths from a signer to trusted certificates in which each signature holds, the shortest first. OpenSSL
/// follows one path alone, by names and key identifiers, which anybody can imitate in the unsigned part of a
/// token, and which roots of one name, renewed and cross-certified certificates share.
class SignedPaths {
 public:
  using Path = VerifiedSignatures::Path;  // borrowed

  SignedPaths(const std::vector<Certificate>& trusted, X509* signer, STACK_OF(X509) * helpers,
              VerifiedSignatures& verified)
      : verified_(verified) {
    for (const auto& certificate : trusted) issuers_.push_back(certificate.get());
    trusted_ = issuers_.size();
    take_descendants(helpers);
    for (const auto& certificate : trusted)
      if (X509_cmp(certificate.get(), signer) == 0) complete_.push_back({signer});
    std::deque<Path> begun{{signer}};
    for (std::size_t followed = 0; !begun.empty() && followed < kMostPaths; ++followed) {
      const Path path = std::move(begun.front());
      begun.pop_front();
      for (std::size_t i = 0; i < issuers_.size(); ++i) {
        if (std::find(path.begin(), path.end(), issuers_[i]) != path.end() ||
            !verified_.is_by(path.back(), issuers_[i])) {
          continue;
        }
        std::deque<Path>& out = i < trusted_ ? complete_ : begun;
        if (out.size() == kMostPaths || path.size() == kLongestPath) {
          is_cut_ = true;
          continue;
        }
        out.push_back(path);
        out.back().push_back(issuers_[i]);
      }
    }
    is_cut_ = is_cut_ || !begun.empty();
    forget_openssl_errors();
  }

  [[nodiscard]] const std::deque<Path>& complete() const { return complete_; }
  /// Whether there may be more.
  [[nodiscard]] bool is_cut() const { return is_cut_; }

 private:
  static constexpr std::size_t kMostPaths = 32, kLongestPath = 16;

  /// Those that descend from a trusted one: what else is enclosed is anybody's.
  void take_descendants(STACK_OF(X509) * helpers) {
    for (std::size_t next = 0; next < issuers_.size(); ++next) {
      for (int i = 0; i < sk_X509_num(helpers); ++i) {
        X509* const helper = sk_X509_value(helpers, i);
        // The same certificate twice, or in another spelling, would only make more paths.
        const auto is_it = [&](X509* known) { return known == helper || X509_cmp(known, helper) == 0; };
        if (std::find(issuers_.begin(), issuers_.end(), helper) == issuers_.end() &&
            verified_.is_by(helper, issuers_[next]) && std::ranges::none_of(issuers_, is_it)) {
          issuers_.push_back(helper);
        }
      }
    }
  }

  VerifiedSignatures& verified_;
  std::vector<X509*> issuers_;  // trusted ones first
  std::size_t trusted_ = 0;     // how many of them
  std::deque<Path> complete_;
  bool is_cut_ = false;
};

/// One path of SignedPaths, with nothing else that could be taken in its place.
std::optional<Refusal> validate_only(const SignedPaths::Path& path, UtcTime time) {
  const CertificateStore store(X509_STORE_new());
  if (!store || X509_STORE_add_cert(store.get(), path.back()) != 1) {
    throw Error("cannot make a certificate store: " + crypto::last_openssl_error());
  }
  const BorrowedCertificates between(sk_X509_new_null());
  for (std::size_t i = 1; i + 1 < path.size(); ++i) sk_X509_push(between.get(), path[i]);
  return validate(store.get(), path.front(), between.get(), time, X509_V_FLAG_PARTIAL_CHAIN).refusal;
}

CertificatePath of_certificates(const SignedPaths::Path& path) {
  CertificatePath out;
  for (X509* certificate : path) {
    X509_up_ref(certificate);
    out.certificates.emplace_back(certificate);
  }
  return out;
}

}  // namespace

std::optional<Refusal> check_signer_certificate(X509* signer, UtcTime time) {
  int critical = -1;
  const ExtendedKeyUsage usage(
      static_cast<EXTENDED_KEY_USAGE*>(X509_get_ext_d2i(signer, NID_ext_key_usage, &critical, nullptr)));
  forget_openssl_errors();
  if (!usage || critical != 1 || sk_ASN1_OBJECT_num(usage.get()) != 1 ||
      OBJ_obj2nid(sk_ASN1_OBJECT_value(usage.get(), 0)) != NID_time_stamp) {
    return Refusal{
        TokenCode::kNotATimeStampSigner,
        "the certificate of " + subject_of(signer) +
            " is not for time-stamping alone (RFC 3161 demands a critical, sole timeStamping key usage)"};
  }
  if (!is_valid_at(signer, seconds_of(time))) {
    return Refusal{TokenCode::kCertificateNotValidAtTime, "the certificate of " + subject_of(signer) +
                                                              " was not valid at the token's time, " +
                                                              format_utc(time)};
  }
  return {};
}

bool VerifiedSignatures::is_by(X509* certificate, X509* issuer) {
  if (X509_NAME_cmp(X509_get_issuer_name(certificate), X509_get_subject_name(issuer)) != 0) return false;
  const auto [known, is_new] = known_.try_emplace({certificate, issuer}, false);
  if (is_new) known->second = take(1) && X509_verify(certificate, X509_get0_pubkey(issuer)) == 1;
  return known->second;
}

bool VerifiedSignatures::take(std::size_t signatures) {
  if (signatures > left_) {
    left_ = 0;
    is_spent_ = true;
    return false;
  }
  left_ -= signatures;
  return true;
}

std::optional<std::optional<Refusal>> VerifiedSignatures::refusal_of(
    const Path& path, UtcTime time, const std::function<std::optional<Refusal>(const Path&)>& validate) {
  // Time enters a validation by this alone.
  std::time_t seconds = seconds_of(time);
  std::vector<int> validity;
  for (const X509* certificate : path) {
    validity.push_back(X509_cmp_time(X509_get0_notBefore(certificate), &seconds));
    validity.push_back(X509_cmp_time(X509_get0_notAfter(certificate), &seconds));
  }
  const auto known = refusals_.find({path, validity});
  if (known == refusals_.end()) {
    if (!take(path.size())) return {};
    return refusals_.emplace(std::pair(path, std::move(validity)), validate(path)).first->second;
  }
  if (known->second && known->second->code == TokenCode::kRootNotValidAtTime)
    return root_not_valid(subject_of(path.back()), time);
  return known->second;
}

CertificatePath validate_path(X509_STORE* store, const std::vector<Certificate>& trusted, X509* signer,
                              STACK_OF(X509) * helpers, UtcTime time, VerifiedSignatures& verified) {
  CertificatePath first = validate(store, signer, helpers, time, 0);
  if (first.refusal && first.refusal->code == TokenCode::kIssuerUnknown) {
    first = validate(store, signer, helpers, time, X509_V_FLAG_PARTIAL_CHAIN);
  }
  if (!first.refusal) return first;
  const SignedPaths paths(trusted, signer, helpers, verified);
  for (const SignedPaths::Path& path : paths.complete()) {
    const auto refusal = verified.refusal_of(
        path, time, [&](const SignedPaths::Path& asked) { return validate_only(asked, time); });
    if (!refusal) break;
    if (!*refusal) return of_certificates(path);
    // What accuses must hold of each path.
    if (!first.is_signed || verdict_of((*refusal)->code) == TokenVerdict::kCouldNotCheck)
      first.refusal = *refusal;
    first.is_signed = true;
  }
  if (verified.is_spent() || paths.is_cut()) {
    first.refusal = Refusal{TokenCode::kTooDear,
                            "the certificates that were given certify each other in so many ways that not "
                            "every path from " +
                                subject_of(signer) + " was looked at"};
  }
  return first;
}

}  // namespace kiroku::timestamp

#include "timestamp/certificate_path.h"

#include <algorithm>
#include <ctime>

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

Refusal refusal_of(X509_STORE_CTX* context) {
  const int error = X509_STORE_CTX_get_error(context);
  const int depth = X509_STORE_CTX_get_error_depth(context);
  const X509* at = X509_STORE_CTX_get_current_cert(context);
  const TokenCode code = code_of(error, depth);
  const std::string who = at != nullptr ? subject_of(at) : std::string("the signer");
  if (code == TokenCode::kIssuerUnknown) {
    return {code, "no path leads from " + who + " to a trusted root: give the authority's root and chain"};
  }
  return {code, "the certificate path does not hold at " + who + ": " + X509_verify_cert_error_string(error)};
}

/// Those of `helpers` that descend from `trusted` by signatures: OpenSSL picks issuers by name and key
/// identifier, which anybody can imitate in the unsigned part of a token.
BorrowedCertificates vouched_for(const std::vector<Certificate>& trusted, STACK_OF(X509) * helpers) {
  BorrowedCertificates out(sk_X509_new_null());
  std::vector<X509*> issuers;
  issuers.reserve(trusted.size());
  for (const auto& certificate : trusted) issuers.push_back(certificate.get());
  // Each certificate that is found in turn may have issued others; whoever is in `issuers` is tried once.
  for (std::size_t next = 0; next < issuers.size(); ++next) {
    X509* issuer = issuers[next];
    for (int i = 0; i < sk_X509_num(helpers); ++i) {
      X509* helper = sk_X509_value(helpers, i);
      if (std::find(issuers.begin(), issuers.end(), helper) != issuers.end() ||
          X509_NAME_cmp(X509_get_issuer_name(helper), X509_get_subject_name(issuer)) != 0 ||
          X509_verify(helper, X509_get0_pubkey(issuer)) != 1) {
        continue;
      }
      sk_X509_push(out.get(), helper);
      issuers.push_back(helper);
    }
  }
  forget_openssl_errors();
  return out;
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
    out.refusal = refusal_of(context.get());
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

CertificatePath validate_path(X509_STORE* store, const std::vector<Certificate>& trusted, X509* signer,
                              STACK_OF(X509) * helpers, UtcTime time) {
  const auto attempt = [&](STACK_OF(X509) * between) {
    CertificatePath path = validate(store, signer, between, time, 0);
    if (path.refusal && path.refusal->code == TokenCode::kIssuerUnknown) {
      path = validate(store, signer, between, time, X509_V_FLAG_PARTIAL_CHAIN);
    }
    return path;
  };
  CertificatePath path = attempt(helpers);
  if (!path.refusal) return path;
  CertificatePath clean = attempt(vouched_for(trusted, helpers).get());
  return clean.refusal ? std::move(path) : std::move(clean);
}

}  // namespace kiroku::timestamp

#include "timestamp/token_verifier.h"

#include <algorithm>
#include <array>
#include <set>

#include <openssl/core_names.h>

#include "crypto/encoding.h"
#include "timestamp/authority.h"
#include "timestamp/certificate_path.h"
#include "timestamp/certificate_pool_state.h"
#include "timestamp/own_authority.h"
#include "timestamp/signature_use.h"
#include "timestamp/signed_attributes.h"
#include "timestamp/token_parts.h"
#include "timestamp/trust_store_state.h"

namespace kiroku::timestamp {
namespace {

struct CodeEntry {
  TokenCode code;
  std::string_view name;
  TokenVerdict verdict;
};
constexpr std::array kCodes{
    CodeEntry{TokenCode::kValid, "token-valid", TokenVerdict::kValid},
    CodeEntry{TokenCode::kNotAToken, "token-not-a-token", TokenVerdict::kRefused},
    CodeEntry{TokenCode::kRejected, "token-rejected", TokenVerdict::kRefused},
    CodeEntry{TokenCode::kMalformed, "token-malformed", TokenVerdict::kRefused},
    CodeEntry{TokenCode::kSignerCount, "token-signer-count", TokenVerdict::kRefused},
    CodeEntry{TokenCode::kSignerNotIdentified, "token-signer-not-identified", TokenVerdict::kRefused},
    CodeEntry{TokenCode::kSignatureInvalid, "token-signature-invalid", TokenVerdict::kRefused},
    CodeEntry{TokenCode::kWeakAlgorithm, "token-weak-algorithm", TokenVerdict::kRefused},
    CodeEntry{TokenCode::kImprintDiffers, "token-imprint-differs", TokenVerdict::kRefused},
    CodeEntry{TokenCode::kNonceDiffers, "token-nonce-differs", TokenVerdict::kRefused},
    CodeEntry{TokenCode::kPolicyDiffers, "token-policy-differs", TokenVerdict::kRefused},
    CodeEntry{TokenCode::kNotATimeStampSigner, "token-not-a-time-stamp-signer", TokenVerdict::kRefused},
    CodeEntry{TokenCode::kCertificateNotValidAtTime, "token-certificate-not-valid-at-time",
              TokenVerdict::kRefused},
    CodeEntry{TokenCode::kChainInvalid, "token-chain-invalid", TokenVerdict::kRefused},
    CodeEntry{TokenCode::kSignerCertificateMissing, "token-signer-certificate-missing",
              TokenVerdict::kCouldNotCheck},
    CodeEntry{TokenCode::kIssuerUnknown, "token-issuer-unknown", TokenVerdict::kCouldNotCheck},
    CodeEntry{TokenCode::kRootNotValidAtTime, "token-root-not-valid-at-time", TokenVerdict::kCouldNotCheck},
    CodeEntry{TokenCode::kNoTrust, "token-no-trust", TokenVerdict::kCouldNotCheck},
    CodeEntry{TokenCode::kTooDear, "token-too-dear", TokenVerdict::kCouldNotCheck},
};

const CodeEntry& entry_of(TokenCode code) {
  return *std::find_if(kCodes.begin(), kCodes.end(),
                       [&](const CodeEntry& entry) { return entry.code == code; });
}

/// PKIStatus of RFC 3161 section 2.4.2.
std::string status_name(int status) {
  constexpr std::array<std::string_view, 6> kNames{"granted", "grantedWithMods",   "rejection",
                                                   "waiting", "revocationWarning", "revocationNotification"};
  const auto index = static_cast<std::size_t>(status);
  return index < kNames.size() ? std::string(kNames[index]) : "status " + std::to_string(status);
}

/// PKIFailureInfo of RFC 3161 section 2.4.2, by bit number.
std::string failure_name(int bit) {
  constexpr std::array kNames{std::pair(0, "badAlg"),
                              std::pair(2, "badRequest"),
                              std::pair(5, "badDataFormat"),
                              std::pair(14, "timeNotAvailable"),
                              std::pair(15, "unacceptedPolicy"),
                              std::pair(16, "unacceptedExtension"),
                              std::pair(17, "addInfoNotAvailable"),
                              std::pair(25, "systemFailure")};
  const auto* known =
      std::find_if(kNames.begin(), kNames.end(), [&](const auto& name) { return name.first == bit; });
  return known != kNames.end() ? known->second : "failure " + std::to_string(bit);
}

bool same_bytes(ByteView a, ByteView b) { return std::equal(a.begin(), a.end(), b.begin(), b.end()); }

ByteView without_leading_zeros(ByteView number) {
  while (number.size() > 1 && number[0] == std::byte{0}) number = number.subspan(1);
  return number;
}

/// Whether one signature by the certificate's key can take longer than some milliseconds. OpenSSL takes an
/// exponent as long as the modulus (4 ms at 2048 bits, 100 times what the usual one takes), moduli of 16,384
/// bits and any curve; a folder can hold thousands of tokens.
bool is_dear(const X509* signer) {
  constexpr int kMostRsaBits = 8192;
  constexpr int kMostExponentBits = 33;  // 2^32 + 1; those in use are 3 and 65537
  constexpr int kMostDsaBits = 3072;
  constexpr int kMostCurveBits = 521;
  EVP_PKEY* const key = X509_get0_pubkey(signer);
  if (key == nullptr) return false;  // no signature fits it
  const int bits = EVP_PKEY_get_bits(key);
  switch (EVP_PKEY_get_base_id(key)) {
    case EVP_PKEY_RSA:
    case EVP_PKEY_RSA_PSS: {
      BIGNUM* number = nullptr;
      EVP_PKEY_get_bn_param(key, OSSL_PKEY_PARAM_RSA_E, &number);
      const BigNumber exponent(number);
      return bits > kMostRsaBits || !exponent || BN_num_bits(exponent.get()) > kMostExponentBits;
    }
    case EVP_PKEY_EC: {
      // A curve without a name is one that somebody made up.
      std::array<char, 80> name{};
      return bits > kMostCurveBits || EVP_PKEY_get_group_name(key, name.data(), name.size(), nullptr) != 1;
    }
    case EVP_PKEY_DSA:
      return bits > kMostDsaBits;
    case EVP_PKEY_ED25519:
    case EVP_PKEY_ED448:
      return false;
    default:
      return true;
  }
}

Bytes hashes_of(const std::set<crypto::Sha256Digest>& hashes) {
  Bytes out;
  for (const crypto::Sha256Digest& hash : hashes) out.insert(out.end(), hash.begin(), hash.end());
  return out;
}

/// One judgement: each step either finds a reason against the token or lets it pass to the next. What speaks
/// against the token itself comes before what merely cannot be checked.
class Judge {
 public:
  Judge(const Expectation& expectation, const TrustStore& trust)
      : expectation_(expectation), trust_(TokenVerifierAccess::state_of(trust)) {}

  TokenJudgement judge(ByteView response_or_token) {
    std::optional<Refusal> refusal = read(response_or_token);
    if (!refusal) refusal = check_expectation();
    if (!refusal) refusal = find_signer();
    if (!refusal && !expectation_.judge_strangers) refusal = check_for_stranger();
    if (!refusal) refusal = check_signature();
    if (!refusal) refusal = check_path();
    if (refusal) {
      out_.code = refusal->code;
      out_.explanation = std::move(refusal->explanation);
    } else {
      out_.code = TokenCode::kValid;
      out_.explanation = "signed by " + out_.signer_subject + " at " + format_utc(out_.info->gen_time);
    }
    return std::move(out_);
  }

 private:
  std::optional<Refusal> read(ByteView response_or_token);
  /// The token's envelope, and its certificates from the pool where there is one.
  std::optional<Refusal> open(ByteView token);
  std::optional<Refusal> take_certificates(const std::vector<ByteView>& certificates);
  std::optional<Refusal> check_expectation() const;
  std::optional<Refusal> find_signer();
  std::optional<Refusal> check_for_stranger();
  std::optional<Refusal> check_signature();
  std::optional<Refusal> check_path();
  /// A path to a trusted certificate, or why there is none; found once.
  const CertificatePath& path();
  [[nodiscard]] bool nobody_is_trusted() const {
    return trust_.outside.certificates.empty() && trust_.own.certificates.empty();
  }
  [[nodiscard]] std::string no_trust_words() const {
    return "no trusted root certificate was given, so nobody vouches for " + out_.signer_subject;
  }

  const Expectation& expectation_;
  const TokenVerifierAccess::State& trust_;
  CmsContent envelope_;
  ByteView content_;                       // the TSTInfo inside envelope_
  CMS_SignerInfo* signer_info_ = nullptr;  // inside envelope_
  SignedAttributes attributes_;
  OwnedCertificates enclosed_;            // the token's own certificates
  crypto::Sha256Digest enclosed_hash_{};  // of those of a pool
  X509* signer_ = nullptr;                // one of enclosed_ or trust_
  std::optional<crypto::HashAlgorithm> signature_hash_;
  std::optional<CertificatePath> path_;
  bool path_is_own_ = false;     // it ends at the recorder's own authority
  bool path_is_signed_ = false;  // of a refused one: at another time one may hold
  bool is_of_the_pool_ = false;  // enclosed_
  TokenJudgement out_;
};

std::optional<Refusal> Judge::read(ByteView response_or_token) {
  std::string why;
  const auto response = parse_response(response_or_token, why);
  if (!response) return Refusal{TokenCode::kNotAToken, why};
  if (response->token.empty()) {
    std::string text = "the authority rejected the request (" + status_name(response->status);
    if (response->failure_info) text += ", " + failure_name(*response->failure_info);
    text += ")";
    for (const std::string& line : response->status_text) text += ": " + line;
    return Refusal{TokenCode::kRejected, text};
  }
  if (auto refusal = open(response->token)) return refusal;
  const auto content = attached_info(envelope_.get(), why);
  if (!content) return Refusal{TokenCode::kMalformed, why};
  content_ = *content;
  out_.info = parse_tst_info(content_, why);
  if (!out_.info) return Refusal{TokenCode::kMalformed, why};

  STACK_OF(CMS_SignerInfo)* signers = CMS_get0_SignerInfos(envelope_.get());
  if (const int count = sk_CMS_SignerInfo_num(signers); count != 1) {
    return Refusal{TokenCode::kSignerCount, "the token has " + std::to_string(std::max(count, 0)) +
                                                " signers, where RFC 3161 demands exactly one"};
  }
  signer_info_ = sk_CMS_SignerInfo_value(signers, 0);

  // RFC 5652 section 5.1: 3 for content other than plain data; 4 and 5 where attribute certificates or
  // foreign revocation data (OCSP answers) are enclosed, for which real tokens say 3 as well as 5.
  // Section 5.3: 1 with issuer and serial number, 3 with a subject key identifier.
  const EnvelopeVersions versions = versions_of(response->token);
  if (versions.signed_data < 3 || versions.signed_data > 5) {
    return Refusal{TokenCode::kMalformed, "the token's SignedData has version " +
                                              std::to_string(versions.signed_data) +
                                              ", which RFC 5652 forbids"};
  }
  ASN1_OCTET_STRING* key_identifier = nullptr;
  CMS_SignerInfo_get0_signer_id(signer_info_, &key_identifier, nullptr, nullptr);
  if (versions.signer_info != (key_identifier == nullptr ? 1 : 3)) {
    return Refusal{TokenCode::kMalformed, "the token's SignerInfo has version " +
                                              std::to_string(versions.signer_info) +
                                              ", which RFC 5652 forbids for the way it names its signer"};
  }
  Refusal refusal;
  auto attributes = read_signed_attributes(signer_info_, refusal);
  if (!attributes) return refusal;
  attributes_ = std::move(*attributes);
  return {};
}

std::optional<Refusal> Judge::open(ByteView token) {
  std::string why;
  const auto split = expectation_.pool != nullptr ? split_certificates(token) : std::nullopt;
  envelope_ = parse_envelope(split ? split->envelope : token, why);
  if (!envelope_) return Refusal{TokenCode::kNotAToken, why};
  if (split) return take_certificates(split->certificates);
  enclosed_.reset(CMS_get1_certs(envelope_.get()));
  forget_openssl_errors();
  return {};
}

std::optional<Refusal> Judge::take_certificates(const std::vector<ByteView>& certificates) {
  CertificatePoolAccess::State& pool = CertificatePoolAccess::state_of(*expectation_.pool);
  enclosed_.reset(sk_X509_new_null());
  std::set<crypto::Sha256Digest> taken;
  for (const ByteView der : certificates) {
    const crypto::Sha256Digest hash = crypto::sha256(der);
    if (!taken.insert(hash).second) continue;
    auto known = pool.certificates.find(hash);
    if (known == pool.certificates.end()) {
      if (pool.certificates.size() >= CertificatePool::kMostCertificates) {
        return Refusal{TokenCode::kTooDear, "the tokens judged before it enclose " +
                                                std::to_string(CertificatePool::kMostCertificates) +
                                                " different certificates, and this one encloses more"};
      }
      known = pool.certificates.emplace(hash, decode_with<Certificate, d2i_X509>(der)).first;
    }
    if (!known->second) return Refusal{TokenCode::kNotAToken, std::string(kNoSignedData)};
    X509_up_ref(known->second.get());
    sk_X509_push(enclosed_.get(), known->second.get());
  }
  enclosed_hash_ = crypto::sha256(hashes_of(taken));
  is_of_the_pool_ = true;
  return {};
}

std::optional<Refusal> Judge::check_expectation() const {
  const TokenInfo& info = *out_.info;
  if (!info.algorithm) {
    return Refusal{TokenCode::kWeakAlgorithm,
                   "the token's imprint is a " + info.algorithm_name +
                       " hash, and only SHA-2 and SHA-3 of at least 256 bits count here"};
  }
  if (expectation_.algorithm && *expectation_.algorithm != *info.algorithm) {
    return Refusal{TokenCode::kImprintDiffers,
                   "the token is over a " + info.algorithm_name + " hash, where " +
                       std::string(crypto::hash_name(*expectation_.algorithm)) + " was expected"};
  }
  const bool imprint_fits =
      (!expectation_.imprint || same_bytes(*expectation_.imprint, info.imprint)) &&
      (!expectation_.data || same_bytes(crypto::digest(*info.algorithm, *expectation_.data), info.imprint));
  if (!imprint_fits) {
    return Refusal{TokenCode::kImprintDiffers,
                   "the token is about other bytes: its imprint is " + crypto::to_hex(info.imprint)};
  }
  if (expectation_.nonce &&
      (!info.nonce || !same_bytes(without_leading_zeros(*expectation_.nonce), *info.nonce))) {
    return Refusal{TokenCode::kNonceDiffers,
                   info.nonce
                       ? "the token answers another request: its nonce is " + crypto::to_hex(*info.nonce)
                       : "the token carries no nonce, although the request did"};
  }
  if (expectation_.policy && *expectation_.policy != info.policy) {
    return Refusal{TokenCode::kPolicyDiffers,
                   "the token was issued under policy " + info.policy + ", not " + *expectation_.policy};
  }
  return {};
}

std::optional<Refusal> Judge::find_signer() {
  std::vector<X509*> candidates;
  const int enclosed = std::max(sk_X509_num(enclosed_.get()), 0);
  candidates.reserve(static_cast<std::size_t>(enclosed) + trust_.untrusted.size() +
                     trust_.outside.certificates.size() + trust_.own.certificates.size());
  for (int i = 0; i < enclosed; ++i) candidates.push_back(sk_X509_value(enclosed_.get(), i));
  for (const auto& certificate : trust_.untrusted) candidates.push_back(certificate.get());
  for (const Anchors* anchors : {&trust_.outside, &trust_.own}) {
    for (const auto& certificate : anchors->certificates) candidates.push_back(certificate.get());
  }

  const auto is_signer = [&](const X509* certificate) {
    return std::all_of(
        attributes_.signer.begin(), attributes_.signer.end(),
        [&](const CertificateIdentifier& identifier) { return fits(identifier, certificate); });
  };
  const auto found = std::find_if(candidates.begin(), candidates.end(), is_signer);
  if (found == candidates.end()) {
    if (enclosed == 0) {
      return Refusal{TokenCode::kSignerCertificateMissing,
                     "the token encloses no certificate and none of those given is its signer's: give the "
                     "authority's chain"};
    }
    return Refusal{TokenCode::kSignerNotIdentified,
                   "none of the certificates in the token is the one that its ESSCertID names"};
  }
  if (CMS_SignerInfo_cert_cmp(signer_info_, *found) != 0) {
    return Refusal{TokenCode::kSignerNotIdentified,
                   "the token's ESSCertID and its SignerInfo name different certificates"};
  }
  signer_ = *found;
  out_.signer_subject = subject_of(signer_);
  return {};
}

std::optional<Refusal> Judge::check_signature() {
  X509_ALGOR* digest_identifier = nullptr;
  X509_ALGOR* signature_identifier = nullptr;
  CMS_SignerInfo_get0_algs(signer_info_, nullptr, nullptr, &digest_identifier, &signature_identifier);
  const auto algorithm = hash_algorithm_of(digest_identifier);
  if (!algorithm) {
    const ASN1_OBJECT* object = nullptr;
    X509_ALGOR_get0(&object, nullptr, nullptr, digest_identifier);
    return Refusal{TokenCode::kWeakAlgorithm,
                   "the token is signed over a " + name_of(object) +
                       " hash, and only SHA-2 and SHA-3 of at least 256 bits count here"};
  }
  signature_hash_ = algorithm;
  // A signature algorithm that names a hash of its own must name the same one.
  const ASN1_OBJECT* signature_object = nullptr;
  X509_ALGOR_get0(&signature_object, nullptr, nullptr, signature_identifier);
  int signature_hash = NID_undef;
  if (OBJ_find_sigid_algs(OBJ_obj2nid(signature_object), &signature_hash, nullptr) == 1 &&
      signature_hash != NID_undef && signature_hash != EVP_MD_get_type(message_digest_of(*algorithm))) {
    return Refusal{TokenCode::kMalformed, "the token's signature algorithm " + name_of(signature_object) +
                                              " contradicts its digest algorithm"};
  }
  if (!same_bytes(crypto::digest(*algorithm, content_), attributes_.message_digest)) {
    return Refusal{TokenCode::kSignatureInvalid,
                   "the TSTInfo is not what was signed (message-digest differs)"};
  }
  CMS_SignerInfo_set1_signer_cert(signer_info_, signer_);
  if (is_dear(signer_)) {
    return Refusal{TokenCode::kTooDear,
                   "the key of " + out_.signer_subject +
                       " is of a kind or size that no authority uses: its signature would "
                       "take too long to judge"};
  }
  const bool verified = CMS_SignerInfo_verify(signer_info_) == 1;
  forget_openssl_errors();
  if (!verified) {
    return Refusal{TokenCode::kSignatureInvalid, "the token's signature is not by " + out_.signer_subject};
  }
  return {};
}

const CertificatePath& Judge::path() {
  if (path_) return *path_;
  const BorrowedCertificates helpers(sk_X509_new_null());
  const auto add = [&](X509* certificate) { sk_X509_push(helpers.get(), certificate); };
  for (const auto& certificate : trust_.untrusted) add(certificate.get());
  for (int i = 0; i < sk_X509_num(enclosed_.get()); ++i) add(sk_X509_value(enclosed_.get(), i));
  auto* const pool = is_of_the_pool_ ? &CertificatePoolAccess::state_of(*expectation_.pool) : nullptr;
  const auto path_to = [&](const Anchors& anchors, VerifiedSignatures* known) {
    VerifiedSignatures its_own;  // where the certificates are of no pool, which outlives this
    return validate_path(anchors.store.get(), anchors.certificates, signer_, helpers.get(),
                         out_.info->gen_time, known != nullptr ? *known : its_own);
  };
  // A path to the recorder's own authority counts first, so that no other path can hide it.
  path_ = path_to(trust_.own, pool != nullptr ? &pool->verified_own : nullptr);
  path_is_own_ = !path_->refusal;
  path_is_signed_ = path_->is_signed;
  if (!path_is_own_ && !trust_.outside.certificates.empty()) {
    CertificatePath outside = path_to(trust_.outside, pool != nullptr ? &pool->verified_outside : nullptr);
    path_is_signed_ = path_is_signed_ || outside.is_signed;
    // Of two refusals the one that knew the issuer says more, and what accuses must hold of both.
    const bool said_more = path_->refusal->code != TokenCode::kIssuerUnknown && outside.refusal &&
                           (outside.refusal->code == TokenCode::kIssuerUnknown ||
                            verdict_of(path_->refusal->code) == TokenVerdict::kCouldNotCheck);
    if (!said_more) path_ = std::move(outside);
  }
  return *path_;
}

std::optional<Refusal> Judge::check_for_stranger() {
  if (check_signer_certificate(signer_, out_.info->gen_time)) return {};  // told in its place
  std::string* known = nullptr;  // why there is no path from this signer, with these certificates
  if (expectation_.pool != nullptr && !nobody_is_trusted()) {
    const Bytes der = encode_with<i2d_X509>(signer_);
    Bytes key = to_bytes(text_of(crypto::sha256(der)));
    key.insert(key.end(), enclosed_hash_.begin(), enclosed_hash_.end());
    known = &CertificatePoolAccess::state_of(*expectation_.pool).without_path[crypto::sha256(key)];
  }
  std::optional<Refusal> refusal;
  if (nobody_is_trusted()) {
    refusal = Refusal{TokenCode::kNoTrust, no_trust_words()};
  } else if (known != nullptr && !known->empty()) {
    refusal = Refusal{TokenCode::kIssuerUnknown, *known};
  } else {
    refusal = path().refusal;
  }
  if (!refusal || verdict_of(refusal->code) != TokenVerdict::kCouldNotCheck) return {};
  if (known != nullptr && refusal->code == TokenCode::kIssuerUnknown && !path_is_signed_)
    *known = refusal->explanation;
  refusal->explanation += "; whether its signature holds was not looked at";
  return refusal;
}

std::optional<Refusal> Judge::check_path() {
  if (auto refusal = check_signer_certificate(signer_, out_.info->gen_time)) return refusal;
  if (nobody_is_trusted()) return Refusal{TokenCode::kNoTrust, no_trust_words()};
  const CertificatePath& path = this->path();
  if (path.refusal) return path.refusal;
  const bool own =
      path_is_own_ || out_.info->policy == kEmbeddedPolicy ||
      std::any_of(path.certificates.begin(), path.certificates.end(), [&](const Certificate& certificate) {
        return is_own_authority(certificate.get(), trust_.own.certificates);
      });
  out_.authority = own ? TimeAuthority::kOwn : TimeAuthority::kOutside;
  out_.root_subject = subject_of(path.certificates.back().get());
  out_.signatures = signatures_on(*signature_hash_, path.certificates);
  out_.valid_until = end_of(path.certificates);
  for (const auto& certificate : path.certificates) {
    out_.chain.push_back(encode_with<i2d_X509>(certificate.get()));
  }
  return {};
}

}  // namespace

std::string_view authority_kind_name(TimeAuthority authority) {
  return authority == TimeAuthority::kOutside ? "external" : "self-issued";
}

std::string_view code_name(TokenCode code) { return entry_of(code).name; }

TokenVerdict verdict_of(TokenCode code) { return entry_of(code).verdict; }

TokenJudgement judge_token(ByteView response_or_token, const Expectation& expectation,
                           const TrustStore& trust) {
  return Judge(expectation, trust).judge(response_or_token);
}

}  // namespace kiroku::timestamp

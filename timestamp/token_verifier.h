// Judging RFC 3161 tokens: RFC 3161 section 2.3/2.4.2, RFC 5652 section 5.4-5.6, RFC 5035 and RFC 5816
// (ESSCertIDv2), RFC 5280 path validation at genTime. TrustStore is immutable after filling; judging is
// thread-safe.
//
// What is demanded, in this order, so that what speaks against the token itself is told before what merely
// could not be checked:
//  1. a granted TimeStampResp (DER) or bare token (CMS; BER where CMS permits it), nothing after it; a
//  TSTInfo
//     attached, in DER, version 1, without critical extensions; one SignerInfo; the versions that RFC 5652
//     assigns; content-type, message-digest and ESSCertID or ESSCertIDv2 (or both) as signed attributes, each
//     once;
//  2. SHA-2 or SHA-3 of at least 256 bits as imprint; imprint, nonce and policy as expected;
//  3. the signer: the certificate whose hash the ESSCertIDs give, among those in the token and those given;
//  it must
//     also be the one that the SignerInfo names. Where it stands in the token means nothing;
//  4. its signature, over one of the same hashes;
//  5. its extended key usage, critical and timeStamping alone; its validity at genTime;
//  6. a path to a trusted certificate, wholly valid at genTime, of at least 112 bits of security. Whether
//  anything
//     has expired since does not matter. A trusted certificate that is not self-signed ends a path, too, if
//     none leads to a root; certificates in the token that have no part in the path cannot spoil it.
// Revocation is not judged.
//
// Whose clock a valid token tells is decided by the trusted certificate at which its path ends, never by what
// its signer wrote into it (timestamp/own_authority.h).
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/bytes.h"
#include "timestamp/certificate_pool.h"
#include "timestamp/request.h"
#include "timestamp/token.h"

namespace kiroku::timestamp {

/// Whose clock stands behind a valid token.
enum class TimeAuthority {
  kOutside,  // an authority that the verifier trusts as independent of the recorder
  kOwn,      // the recorder's own: order is proved, time is what the recorder says
};
std::string_view authority_kind_name(TimeAuthority authority);  // "external", "self-issued"

/// Roots that are trusted and further certificates that merely help to build a chain. Roots of outside
/// authorities and of the recorder's own authority are kept apart: which one a token ends at decides what its
/// time is worth.
class TrustStore {
 public:
  TrustStore();
  TrustStore(TrustStore&&) noexcept;
  TrustStore& operator=(TrustStore&&) noexcept;
  ~TrustStore();
  /// Of outside authorities. PEM (one or several) or DER. Throws kiroku::Error naming the file if there is no
  /// certificate in it. Returns how many.
  std::size_t add_trusted_file(const std::filesystem::path& file);
  std::size_t add_trusted(ByteView pem_or_der, const std::string& name_for_errors);
  /// Of the recorder's own authority, likewise. A certificate that is added as both is the recorder's own.
  std::size_t add_own_authority_file(const std::filesystem::path& file);
  std::size_t add_own_authority(ByteView pem_or_der, const std::string& name_for_errors);
  std::size_t add_untrusted_file(const std::filesystem::path& file);
  std::size_t add_untrusted(ByteView pem_or_der, const std::string& name_for_errors);
  /// Whether there is any root, of either kind.
  [[nodiscard]] bool has_trusted() const;
  /// Subjects of the certificates that were added as outside ones and are the recorder's own authority's: by
  /// their key, or by the name that every embedded authority has.
  [[nodiscard]] std::vector<std::string> own_among_outside() const;

 private:
  friend class TokenVerifierAccess;
  struct State;
  std::unique_ptr<State> state_;
};

/// What the token must be about. Unset members are not checked.
struct Expectation {
  std::optional<crypto::HashAlgorithm> algorithm;
  std::optional<Bytes> imprint;  // hash under the token's own algorithm (or `algorithm`, if set)
  std::optional<Bytes> data;     // alternative to imprint: hashed here with the token's algorithm
  /// Set: the token must carry exactly this nonce (as the request did); `forbid_nonce` is not needed, RFC
  /// 3161 has no such rule.
  std::optional<Bytes> nonce;
  std::optional<std::string> policy;
  /// False: the signature of a token from which no path leads to a trusted root is not looked at, so that it
  /// is kIssuerUnknown or kNoTrust whether it holds or not. For whoever judges thousands: nobody vouches for
  /// such a signature, and its key is chosen by whoever wants the judging to take long.
  bool judge_strangers = true;
  /// Set: what tokens that were judged with it have in common is not computed again. It must have been used
  /// with the same TrustStore alone.
  CertificatePool* pool = nullptr;
};

/// Each refusal has its own code; `code_name` gives the stable text ("token-imprint-differs").
enum class TokenCode {
  kValid,
  // refused: the answer is no
  kNotAToken,            // not DER, HTML, trailing bytes, not a TimeStampResp or CMS
  kRejected,             // the authority refused (PKIStatus)
  kMalformed,            // wrong content type, version, missing or doubled signed attributes
  kSignerCount,          // not exactly one signer
  kSignerNotIdentified,  // no ESSCertID, or no certificate fits it
  kSignatureInvalid,
  kWeakAlgorithm,  // imprint or signature hash that proves nothing any more (MD5, SHA-1)
  kImprintDiffers,
  kNonceDiffers,
  kPolicyDiffers,
  kNotATimeStampSigner,  // extended key usage not critical, not sole, or not timeStamping
  kCertificateNotValidAtTime,
  kChainInvalid,  // a chain exists but is broken (bad signature, not a CA, path length, …)
  // not decided: could not check
  kSignerCertificateMissing,  // token has no certificate and none was given
  kIssuerUnknown,             // no chain to a trusted root could be built
  kRootNotValidAtTime,        // a chain exists, and the trusted certificate that ends it is of another time
  kNoTrust,                   // no trusted roots were given
  kTooDear,  // chosen so that judging takes long: a signer's key that no authority has, certificates without
             // end
};
std::string_view code_name(TokenCode code);

enum class TokenVerdict { kValid, kRefused, kCouldNotCheck };
TokenVerdict verdict_of(TokenCode code);

/// One signature on which a valid token rests: its own, or that on a certificate of its path.
struct SignatureUse {
  std::string key;   // "rsa", "dsa", "ecdsa", "ed25519", "ed448"; OpenSSL's name of any other
  int bits = 0;      // of the modulus or the curve
  std::string hash;  // "sha256", as crypto::hash_name() says it; empty where the key's algorithm has its own
  friend bool operator==(const SignatureUse&, const SignatureUse&) = default;
};

struct TokenJudgement {
  TokenCode code = TokenCode::kNotAToken;
  std::string explanation;               // one sentence
  std::optional<TokenInfo> info;         // whenever the TSTInfo could be read, also when refused
  std::string signer_subject;            // RFC 2253 text of the signer found by ESSCertID; empty if none
  std::string root_subject;              // of the trusted root, when valid
  std::vector<Bytes> chain;              // DER, signer first, trusted certificate last, when valid
  std::vector<SignatureUse> signatures;  // the token's own first, then along the chain, when valid
  std::optional<UtcTime> valid_until;    // when the first certificate of the chain ends, when valid
  TimeAuthority authority = TimeAuthority::kOwn;  // says something when valid
};

/// Judges a TimeStampResp or a bare token.
TokenJudgement judge_token(ByteView response_or_token, const Expectation& expectation,
                           const TrustStore& trust);

}  // namespace kiroku::timestamp

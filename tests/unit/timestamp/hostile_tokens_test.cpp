// Tokens that no honest authority issues, and what each must be told.
#include <algorithm>

#include <gtest/gtest.h>

#include "crypto/encoding.h"
#include "tests/support/judged_alike.h"
#include "tests/support/token_maker.h"
#include "timestamp/certificate_pool_state.h"
#include "timestamp/der.h"
#include "timestamp/token_verifier.h"

namespace kiroku::timestamp {
namespace {

using test::make_response;
using test::make_signer;
using test::make_test_authority;
using test::make_token;
using test::pem_of;
using test::TestAuthority;
using test::TokenRecipe;

class HostileToken : public ::testing::Test {
 protected:
  /// A sound token, to be spoilt.
  TokenRecipe recipe() {
    TokenRecipe out;
    out.signer = &authority_.signer;
    out.enclosed = {authority_.signer.certificate.get()};
    return out;
  }

  static TokenJudgement judge(ByteView token, const TestAuthority& trusted,
                              const Expectation& expectation = {}) {
    TrustStore trust;
    trust.add_trusted(bytes_of(trusted.root_pem()), "test root");
    return test::judge_alike(token, expectation, trust);
  }
  TokenJudgement judge(const TokenRecipe& recipe, const Expectation& expectation = {}) {
    return judge(make_token(recipe), authority_, expectation);
  }

  /// Where in `token` its SignedData's or its only SignerInfo's version stands.
  static std::size_t version_offset(const Bytes& token, bool of_signer_info) {
    const auto content_info = DerReader(token).next(der::kSequence);
    DerReader fields(content_info->content);
    fields.next(der::kObjectIdentifier);
    const auto signed_data = DerReader(fields.next(der::kContext0)->content).next(der::kSequence);
    DerReader members(signed_data->content);
    DerElement member = *members.next();
    if (of_signer_info) {
      while (!members.at_end()) member = *members.next();
      member = *DerReader(DerReader(member.content).next()->content).next();
    }
    return static_cast<std::size_t>(member.content.data() - token.data());
  }

  TestAuthority authority_ = make_test_authority();
};

TEST_F(HostileToken, IsValidWhileUnspoilt) {
  TokenRecipe sound = recipe();
  sound.nonce = 0x8000000000000001;
  for (const bool v1 : {false, true}) {
    sound.identify_v1 = v1;
    const auto judgement = judge(sound);
    EXPECT_EQ(judgement.code, TokenCode::kValid) << judgement.explanation;
    EXPECT_EQ(judgement.signer_subject, "CN=Test signer,O=Test");
    EXPECT_EQ(judgement.root_subject, "CN=Test root,O=Test");
    EXPECT_EQ(judgement.chain.size(), 2U);
  }
  sound.identify_v2 = false;
  EXPECT_EQ(judge(sound).code, TokenCode::kValid);
  sound.by_key_identifier = true;
  EXPECT_EQ(judge(sound).code, TokenCode::kValid);
}

TEST_F(HostileToken, IsReadInAResponseAsWell) {
  EXPECT_EQ(judge(make_response(make_token(recipe())), authority_).code, TokenCode::kValid);
}

TEST_F(HostileToken, WithTwoSignersIsRefused) {
  const TestAuthority other = make_test_authority();
  TokenRecipe spoilt = recipe();
  spoilt.second_signer = &other.signer;
  const auto judgement = judge(spoilt);
  EXPECT_EQ(judgement.code, TokenCode::kSignerCount);
  EXPECT_EQ(judgement.explanation, "the token has 2 signers, where RFC 3161 demands exactly one");
}

TEST_F(HostileToken, WithAnotherCertificateInItsPlaceIsNotAttributedToIt) {
  const TestAuthority other = make_test_authority();
  TokenRecipe spoilt = recipe();
  spoilt.enclosed = {other.signer.certificate.get()};
  const auto judgement = judge(spoilt);
  EXPECT_EQ(judgement.code, TokenCode::kSignerNotIdentified);
  EXPECT_EQ(judgement.signer_subject, "");
}

TEST_F(HostileToken, WithACertificateSlippedInFrontIsAttributedToItsSigner) {
  const TestAuthority other = make_test_authority();
  TokenRecipe spoilt = recipe();
  spoilt.enclosed = {other.signer.certificate.get(), other.ca.certificate.get(),
                     authority_.signer.certificate.get()};
  const auto judgement = judge(spoilt);
  EXPECT_EQ(judgement.code, TokenCode::kValid) << judgement.explanation;
  EXPECT_EQ(judgement.chain.front(), encode_with<i2d_X509>(authority_.signer.certificate.get()));
}

TEST_F(HostileToken, WhoseIdentifierNamesAnotherCertificateThanItsSignerInfoIsRefused) {
  const TestAuthority other = make_test_authority();
  TokenRecipe spoilt = recipe();
  spoilt.identified = other.signer.certificate.get();
  spoilt.enclosed.push_back(other.signer.certificate.get());
  const auto judgement = judge(spoilt);
  EXPECT_EQ(judgement.code, TokenCode::kSignerNotIdentified);
  EXPECT_EQ(judgement.explanation, "the token's ESSCertID and its SignerInfo name different certificates");
}

TEST_F(HostileToken, WithoutCertificateIdentifierIsRefused) {
  TokenRecipe spoilt = recipe();
  spoilt.identify_v2 = false;
  EXPECT_EQ(judge(spoilt).code, TokenCode::kSignerNotIdentified);
}

TEST_F(HostileToken, WhoseIssuerSerialContradictsItsHashIsRefused) {
  TokenRecipe spoilt = recipe();
  spoilt.issuer_serial_of = authority_.signer.certificate.get();
  EXPECT_EQ(judge(spoilt).code, TokenCode::kValid);
  spoilt.issuer_serial_of = authority_.ca.certificate.get();
  EXPECT_EQ(judge(spoilt).code, TokenCode::kSignerNotIdentified);
}

TEST_F(HostileToken, WithoutCertificateCannotBeCheckedUntilItIsGiven) {
  TokenRecipe bare = recipe();
  bare.enclosed.clear();
  const Bytes token = make_token(bare);
  const auto judgement = judge(token, authority_);
  EXPECT_EQ(judgement.code, TokenCode::kSignerCertificateMissing);
  EXPECT_EQ(verdict_of(judgement.code), TokenVerdict::kCouldNotCheck);

  TrustStore trust;
  trust.add_trusted(bytes_of(authority_.root_pem()), "test root");
  trust.add_untrusted(bytes_of(pem_of(authority_.signer.certificate.get())), "test signer");
  EXPECT_EQ(test::judge_alike(token, {}, trust).code, TokenCode::kValid);
}

TEST_F(HostileToken, FromASignerForMoreThanTimeStampingIsRefused) {
  for (const char* usage : {"timeStamping", "critical,timeStamping,codeSigning", "critical,serverAuth", ""}) {
    const TestAuthority lax = make_test_authority(usage);
    TokenRecipe spoilt = recipe();
    spoilt.signer = &lax.signer;
    spoilt.enclosed = {lax.signer.certificate.get()};
    EXPECT_EQ(judge(make_token(spoilt), lax).code, TokenCode::kNotATimeStampSigner) << usage;
  }
}

TEST_F(HostileToken, OutsideTheValidityOfItsCertificateIsRefused) {
  TokenRecipe spoilt = recipe();
  for (const char* time : {"20191231235959Z", "20400101000001Z"}) {
    spoilt.gen_time = time;
    EXPECT_EQ(judge(spoilt).code, TokenCode::kCertificateNotValidAtTime) << time;
  }
  // Certificates that are long expired when somebody looks do not matter, nor ones not valid yet.
  for (const char* time : {"20200101000001Z", "20391231235959Z"}) {
    spoilt.gen_time = time;
    EXPECT_EQ(judge(spoilt).code, TokenCode::kValid) << time;
  }
}

TEST_F(HostileToken, WithVersionsThatContradictItsFormIsRefused) {
  const Bytes sound = make_token(recipe());
  for (const auto& [of_signer_info, version] : {std::pair(true, 3), {true, 0}, {false, 1}, {false, 6}}) {
    Bytes token = sound;
    token[version_offset(token, of_signer_info)] = std::byte(version);
    EXPECT_EQ(judge(token, authority_).code, TokenCode::kMalformed) << of_signer_info << version;
  }
  Bytes token = sound;
  token[version_offset(token, false)] = std::byte{5};
  EXPECT_EQ(judge(token, authority_).code, TokenCode::kValid);
}

TEST_F(HostileToken, WithoutItsContentIsRefused) {
  TokenRecipe spoilt = recipe();
  spoilt.detached = true;
  EXPECT_EQ(judge(spoilt).code, TokenCode::kMalformed);
}

TEST_F(HostileToken, OverOtherContentThanTstInfoIsRefused) {
  TokenRecipe spoilt = recipe();
  spoilt.content_type = NID_pkcs7_data;
  EXPECT_EQ(judge(spoilt).code, TokenCode::kMalformed);
}

TEST_F(HostileToken, FollowedByBytesIsRefused) {
  Bytes token = make_token(recipe());
  token.push_back(std::byte{0});
  EXPECT_EQ(judge(token, authority_).code, TokenCode::kNotAToken);
  Bytes response = make_response(make_token(recipe()));
  response.push_back(std::byte{0});
  EXPECT_EQ(judge(response, authority_).code, TokenCode::kNotAToken);
  // Inside the response, after the token
  EXPECT_EQ(judge(make_response(token), authority_).code, TokenCode::kNotAToken);
  // Inside the token, after the TSTInfo, signed
  TokenRecipe spoilt = recipe();
  spoilt.after_info = Bytes(1);
  EXPECT_EQ(judge(spoilt).code, TokenCode::kMalformed);
}

TEST_F(HostileToken, OverAWeakHashIsRefused) {
  TokenRecipe spoilt = recipe();
  spoilt.imprint_algorithm = NID_sha1;
  spoilt.imprint = Bytes(20, std::byte{0x11});
  const auto judgement = judge(spoilt);
  EXPECT_EQ(judgement.code, TokenCode::kWeakAlgorithm);
  ASSERT_TRUE(judgement.info);
  EXPECT_EQ(judgement.info->algorithm_name, "sha1");
  EXPECT_FALSE(judgement.info->algorithm);
}

TEST_F(HostileToken, SignedOverAWeakHashIsRefused) {
  TokenRecipe spoilt = recipe();
  spoilt.digest = EVP_sha1();
  EXPECT_EQ(judge(spoilt).code, TokenCode::kWeakAlgorithm);
}

TEST_F(HostileToken, WithAnUnknownCriticalExtensionIsRefused) {
  TokenRecipe spoilt = recipe();
  spoilt.critical_extension = true;
  const auto judgement = judge(spoilt);
  EXPECT_EQ(judgement.code, TokenCode::kMalformed);
  EXPECT_EQ(judgement.explanation,
            "the TSTInfo has the critical extension 1.2.3.4.5, which is not known here");
}

TEST_F(HostileToken, OfAnotherTstInfoVersionIsRefused) {
  TokenRecipe spoilt = recipe();
  spoilt.version = 2;
  EXPECT_EQ(judge(spoilt).code, TokenCode::kMalformed);
}

TEST_F(HostileToken, WithATimeThatIsNoneIsRefused) {
  TokenRecipe spoilt = recipe();
  for (const char* time :
       {"20260230000000Z", "20260805091502", "20260805091502+0100", "20260805091560Z", "20260805091502.Z",
        "20260805091502.10Z", "20260805091502,5Z", "202608050915Z", "Z"}) {
    spoilt.gen_time = time;
    EXPECT_EQ(judge(spoilt).code, TokenCode::kMalformed) << time;
  }
  spoilt.gen_time = "20260805091502.1234567Z";
  const auto judgement = judge(spoilt);
  EXPECT_EQ(judgement.code, TokenCode::kValid) << judgement.explanation;
  EXPECT_EQ(format_utc(judgement.info->gen_time), "2026-08-05T09:15:02.123456Z");
}

TEST_F(HostileToken, ChangedAfterSigningIsRefused) {
  const Bytes sound = make_token(recipe());
  const auto replace = [&](std::string_view from, std::string_view to) {
    std::string text(text_of(sound));
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos);
    return to_bytes(text.replace(at, from.size(), to));
  };
  const auto judgement = judge(replace("20260805091502.25Z", "20250805091502.25Z"), authority_);
  EXPECT_EQ(judgement.code, TokenCode::kSignatureInvalid);
  EXPECT_EQ(judgement.explanation, "the TSTInfo is not what was signed (message-digest differs)");
}

TEST_F(HostileToken, NeverPassesWithAnyBitOfWhatItSaysOrSignsFlipped) {
  const Bytes sound = make_token(recipe());
  int still_valid = 0;
  for (std::size_t at = 0; at < sound.size(); ++at) {
    Bytes token = sound;
    token[at] ^= std::byte{0x01};
    const auto judgement = judge(token, authority_);
    if (judgement.code != TokenCode::kValid) continue;
    ++still_valid;
    // Bytes that carry no meaning may change (the digest algorithm list), what the token says may not.
    ASSERT_TRUE(judgement.info);
    EXPECT_EQ(judgement.info->imprint, Bytes(32, std::byte{0x11})) << at;
    EXPECT_EQ(format_utc(judgement.info->gen_time), "2026-08-05T09:15:02.250000Z") << at;
  }
  EXPECT_LT(still_valid, 40);
}

TEST_F(HostileToken, FromAnUnknownAuthorityCannotBeChecked) {
  const TestAuthority other = make_test_authority();
  const auto judgement = judge(make_token(recipe()), other);
  EXPECT_EQ(judgement.code, TokenCode::kIssuerUnknown);
  EXPECT_EQ(verdict_of(judgement.code), TokenVerdict::kCouldNotCheck);
}

// One of a folder's thousands must not take a hundred times as long as an honest one.
TEST_F(HostileToken, ByAKeyThatIsDearToVerifyIsNotChecked) {
  const Credential dear = test::make_signer(authority_, test::make_dear_key());
  TokenRecipe token = recipe();
  token.signer = &dear;
  token.enclosed = {dear.certificate.get()};
  const auto judgement = judge(token);
  EXPECT_EQ(judgement.code, TokenCode::kTooDear) << judgement.explanation;
  EXPECT_EQ(verdict_of(judgement.code), TokenVerdict::kCouldNotCheck);
  for (const char* curve : {"P-384", "P-521", "brainpoolP512r1"}) {
    const Credential usual = test::make_signer(authority_, crypto::PrivateKey(EVP_EC_gen(curve)));
    token.signer = &usual;
    token.enclosed = {usual.certificate.get()};
    EXPECT_EQ(judge(token).code, TokenCode::kValid) << curve;
  }
}

// Whoever judges thousands asks first whether anybody vouches for the signer. A signer that somebody vouches
// for is judged as always.
TEST_F(HostileToken, OfAStrangerIsNotAskedForItsSignatureWhereTheCallerSaysSo) {
  Bytes broken = make_token(recipe());
  broken.back() ^= std::byte{0x01};  // of the signature, which comes last
  const TestAuthority other = make_test_authority();
  EXPECT_EQ(judge(broken, other).code, TokenCode::kSignatureInvalid);
  Expectation few;
  few.judge_strangers = false;
  const auto stranger = judge(broken, other, few);
  EXPECT_EQ(stranger.code, TokenCode::kIssuerUnknown);
  EXPECT_TRUE(stranger.explanation.ends_with("; whether its signature holds was not looked at"))
      << stranger.explanation;
  EXPECT_TRUE(stranger.info);
  EXPECT_EQ(test::judge_alike(broken, few, TrustStore()).code, TokenCode::kNoTrust);
  EXPECT_EQ(judge(broken, authority_, few).code, TokenCode::kSignatureInvalid);
  const auto sound = judge(recipe(), few);
  EXPECT_EQ(sound.code, TokenCode::kValid) << sound.explanation;
  EXPECT_EQ(sound.chain.size(), 2U);
  TokenRecipe wrong = recipe();
  wrong.gen_time = "20500805091502Z";
  EXPECT_EQ(judge(wrong, few).code, TokenCode::kCertificateNotValidAtTime);
}

TEST_F(HostileToken, CannotBeCheckedWithoutAnyTrust) {
  const auto judgement = test::judge_alike(make_token(recipe()), {}, TrustStore());
  EXPECT_EQ(judgement.code, TokenCode::kNoTrust);
  EXPECT_EQ(judgement.signer_subject, "CN=Test signer,O=Test");
}

TEST_F(HostileToken, MayEndAtATrustedCertificateThatIsNoRoot) {
  TrustStore trust;
  trust.add_trusted(bytes_of(pem_of(authority_.signer.certificate.get())), "test signer");
  EXPECT_EQ(test::judge_alike(make_token(recipe()), {}, trust).root_subject, "CN=Test signer,O=Test");
}

TEST_F(HostileToken, ThroughASignerThatIsNoAuthorityIsRefused) {
  // The time-stamping certificate issues another one.
  TestAuthority below;
  below.ca = std::move(authority_.signer);
  below.signer = issue_certificate({.organisation = "Test",
                                    .common_name = "Test impostor",
                                    .role = CertificateRole::kSigner,
                                    .not_before = *parse_utc("2020-01-01T00:00:00Z"),
                                    .not_after = *parse_utc("2040-01-01T00:00:00Z"),
                                    .extended_key_usage = "critical,timeStamping"},
                                   &below.ca);
  TokenRecipe spoilt;
  spoilt.signer = &below.signer;
  spoilt.enclosed = {below.signer.certificate.get(), below.ca.certificate.get()};
  TrustStore trust;
  trust.add_trusted(bytes_of(authority_.root_pem()), "test root");
  EXPECT_EQ(test::judge_alike(make_token(spoilt), {}, trust).code, TokenCode::kChainInvalid);
}

TEST_F(HostileToken, IsNotSpoiltByAnIntermediateThatOnlyLooksRight) {
  CertificateProfile profile{.organisation = "Test",
                             .common_name = "Test intermediate",
                             .role = CertificateRole::kAuthority,
                             .not_before = *parse_utc("2020-01-01T00:00:00Z"),
                             .not_after = *parse_utc("2040-01-01T00:00:00Z"),
                             .extended_key_usage = ""};
  TestAuthority below;
  below.ca = issue_certificate(profile, &authority_.ca);
  profile.common_name = "Test signer";
  profile.role = CertificateRole::kSigner;
  profile.extended_key_usage = "critical,timeStamping";
  below.signer = issue_certificate(profile, &below.ca);
  // The same in every field, key identifier included, but with another key and signature; given first, it is
  // found first.
  const TestAuthority stranger = make_test_authority();
  const Certificate double_of_ca(X509_dup(below.ca.certificate.get()));
  ASSERT_EQ(X509_set_pubkey(double_of_ca.get(), stranger.ca.key.get()), 1);
  ASSERT_GT(X509_sign(double_of_ca.get(), stranger.ca.key.get(), EVP_sha256()), 0);
  TrustStore trust;
  trust.add_trusted(bytes_of(authority_.root_pem()), "test root");
  trust.add_untrusted(bytes_of(pem_of(double_of_ca.get())), "double");

  TokenRecipe recipe;
  recipe.signer = &below.signer;
  recipe.enclosed = {below.signer.certificate.get(), below.ca.certificate.get()};
  const auto judgement = test::judge_alike(make_token(recipe), {}, trust);
  EXPECT_EQ(judgement.code, TokenCode::kValid) << judgement.explanation;
  ASSERT_EQ(judgement.chain.size(), 3U);
  EXPECT_EQ(judgement.chain[1], encode_with<i2d_X509>(below.ca.certificate.get()));

  recipe.enclosed = {below.signer.certificate.get()};
  EXPECT_EQ(test::judge_alike(make_token(recipe), {}, trust).code, TokenCode::kChainInvalid);
}

TEST_F(HostileToken, UnderACertificateSignedOverAWeakHashIsRefused) {
  ASSERT_GT(X509_sign(authority_.signer.certificate.get(), authority_.ca.key.get(), EVP_sha1()), 0);
  EXPECT_EQ(judge(recipe()).code, TokenCode::kWeakAlgorithm);
}

TEST_F(HostileToken, WhoseSignatureAlgorithmContradictsItsDigestIsRefused) {
  Bytes token = make_token(recipe());
  const Bytes ecdsa_with_sha256 = *crypto::from_hex("06082a8648ce3d040302");
  const auto at =
      std::find_end(token.begin(), token.end(), ecdsa_with_sha256.begin(), ecdsa_with_sha256.end());
  ASSERT_NE(at, token.end());
  *(at + std::ssize(ecdsa_with_sha256) - 1) = std::byte{3};  // with SHA-384
  const auto judgement = judge(token, authority_);
  EXPECT_EQ(judgement.code, TokenCode::kMalformed);
  EXPECT_EQ(judgement.explanation,
            "the token's signature algorithm ecdsa-with-SHA384 contradicts its digest algorithm");
}

TEST_F(HostileToken, WithASignedAttributeTwiceIsRefused) {
  // signing-time (…9.5) renamed to message-digest (…9.4)
  Bytes token = make_token(recipe());
  const Bytes signing_time = *crypto::from_hex("06092a864886f70d010905");
  const auto at = std::search(token.begin(), token.end(), signing_time.begin(), signing_time.end());
  ASSERT_NE(at, token.end());
  *(at + std::ssize(signing_time) - 1) = std::byte{4};
  EXPECT_EQ(judge(token, authority_).explanation,
            "the token's signed attribute message-digest does not occur exactly once");
}

TEST_F(HostileToken, ThroughAnIntermediateForOtherPurposesIsRefused) {
  const CertificateProfile intermediate{.organisation = "Test",
                                        .common_name = "Test web CA",
                                        .role = CertificateRole::kAuthority,
                                        .not_before = *parse_utc("2020-01-01T00:00:00Z"),
                                        .not_after = *parse_utc("2040-01-01T00:00:00Z"),
                                        .extended_key_usage = "serverAuth"};
  TestAuthority below;
  below.ca = issue_certificate(intermediate, &authority_.ca);
  CertificateProfile signer = intermediate;
  signer.common_name = "Test signer";
  signer.role = CertificateRole::kSigner;
  signer.extended_key_usage = "critical,timeStamping";
  below.signer = issue_certificate(signer, &below.ca);
  TokenRecipe spoilt;
  spoilt.signer = &below.signer;
  spoilt.enclosed = {below.signer.certificate.get(), below.ca.certificate.get()};
  const auto judgement = judge(make_token(spoilt), authority_);
  EXPECT_EQ(judgement.code, TokenCode::kChainInvalid);
  EXPECT_EQ(judgement.explanation,
            "the intermediate CN=Test web CA,O=Test may not issue time-stamping certificates");
}

TEST_F(HostileToken, AboutOtherBytesIsRefused) {
  Expectation expectation;
  expectation.imprint = Bytes(32, std::byte{0x11});
  EXPECT_EQ(judge(recipe(), expectation).code, TokenCode::kValid);
  expectation.imprint = Bytes(32, std::byte{0x12});
  EXPECT_EQ(judge(recipe(), expectation).code, TokenCode::kImprintDiffers);
  expectation.imprint = Bytes(31, std::byte{0x11});
  EXPECT_EQ(judge(recipe(), expectation).code, TokenCode::kImprintDiffers);
  Expectation algorithm;
  algorithm.algorithm = crypto::HashAlgorithm::kSha512;
  EXPECT_EQ(judge(recipe(), algorithm).code, TokenCode::kImprintDiffers);
  Expectation data;
  data.data = Bytes(3);
  EXPECT_EQ(judge(recipe(), data).code, TokenCode::kImprintDiffers);
  TokenRecipe over_data = recipe();
  over_data.imprint = crypto::digest(crypto::HashAlgorithm::kSha256, Bytes(3));
  EXPECT_EQ(judge(over_data, data).code, TokenCode::kValid);
}

TEST_F(HostileToken, WithAnotherNonceOrNoneIsRefused) {
  Expectation expectation;
  expectation.nonce = Bytes{std::byte{0}, std::byte{0x2a}};
  EXPECT_EQ(judge(recipe(), expectation).code, TokenCode::kNonceDiffers);
  TokenRecipe with_nonce = recipe();
  with_nonce.nonce = 0x2b;
  EXPECT_EQ(judge(with_nonce, expectation).code, TokenCode::kNonceDiffers);
  with_nonce.nonce = 0x2a;
  EXPECT_EQ(judge(with_nonce, expectation).code, TokenCode::kValid);
}

TEST_F(HostileToken, UnderAnotherPolicyIsRefused) {
  Expectation expectation;
  expectation.policy = "1.2.3.4";
  EXPECT_EQ(judge(recipe(), expectation).code, TokenCode::kValid);
  expectation.policy = "1.2.3.5";
  EXPECT_EQ(judge(recipe(), expectation).code, TokenCode::kPolicyDiffers);
}

/// SignedData whose certificates [0] stand there a second time, right behind the first.
Bytes with_certificates_twice(ByteView token) {
  DerReader content_info(sole_element(token, der::kSequence)->content);
  const Bytes type = to_bytes(content_info.next(der::kObjectIdentifier)->whole);
  const DerElement inside = *content_info.next(der::kContext0);
  DerReader members(sole_element(inside.content, der::kSequence)->content);
  Bytes doubled;
  while (const auto member = members.next()) {
    for (int times = member->identifier == der::kContext0 ? 2 : 1; times > 0; --times)
      doubled.insert(doubled.end(), member->whole.begin(), member->whole.end());
  }
  return der_value(der::kSequence, {type, der_value(der::kContext0, {der_value(der::kSequence, {doubled})})});
}

// A bit flipped anywhere: whoever splits a token before OpenSSL reads it must refuse what OpenSSL refuses.
TEST_F(HostileToken, IsJudgedAlikeWithAPoolWhateverBitIsFlipped) {
  TokenRecipe sound = recipe();
  sound.enclosed.push_back(authority_.ca.certificate.get());
  TrustStore trust;
  trust.add_trusted(bytes_of(authority_.root_pem()), "test root");
  const Bytes token = make_token(sound);
  for (std::size_t at = 0; at < token.size(); at += 3) {
    Bytes changed = token;
    changed[at] ^= std::byte{1} << (at / 3 % 8);
    test::judge_alike(changed, {}, trust);
    ASSERT_FALSE(HasFailure()) << "byte " << at;
  }
}

TEST_F(HostileToken, WithTwoSetsOfCertificatesIsNoToken) {
  TrustStore trust;
  trust.add_trusted(bytes_of(authority_.root_pem()), "test root");
  const Bytes token = make_token(recipe());
  const Bytes doubled = with_certificates_twice(token);
  ASSERT_GT(doubled.size(), token.size());
  test::judge_alike(doubled, {}, trust);
  CertificatePool pool;
  Expectation expectation;
  expectation.pool = &pool;
  EXPECT_EQ(judge_token(token, expectation, trust).code, TokenCode::kValid);
  EXPECT_EQ(judge_token(doubled, expectation, trust).code, TokenCode::kNotAToken);
}

TEST_F(HostileToken, AmongThousandsOfOneSignerDecodesItsCertificatesOnce) {
  TrustStore trust;
  trust.add_trusted(bytes_of(make_test_authority().root_pem()), "somebody else's root");
  CertificatePool pool;
  Expectation expectation;
  expectation.judge_strangers = false;
  expectation.pool = &pool;
  TokenRecipe stranger = recipe();
  stranger.enclosed = {authority_.ca.certificate.get(), authority_.signer.certificate.get()};
  for (int second = 10; second < 60; ++second) {
    stranger.gen_time = "202608050915" + std::to_string(second) + "Z";
    const TokenJudgement judgement = judge_token(make_token(stranger), expectation, trust);
    EXPECT_EQ(judgement.code, TokenCode::kIssuerUnknown) << judgement.explanation;
  }
  EXPECT_EQ(CertificatePoolAccess::state_of(pool).certificates.size(), 2U);
  EXPECT_EQ(CertificatePoolAccess::state_of(pool).without_path.size(), 1U);
}

// Each token may enclose certificates of its own, so the pool bounds how many are decoded.
TEST_F(HostileToken, WithMoreCertificatesThanAnyRecordingHasIsNotJudged) {
  TrustStore trust;
  trust.add_trusted(bytes_of(authority_.root_pem()), "test root");
  CertificatePool pool;
  Expectation expectation;
  expectation.pool = &pool;
  const Bytes known = make_token(recipe());
  EXPECT_EQ(judge_token(known, expectation, trust).code, TokenCode::kValid);
  TokenRecipe stuffed = recipe();
  std::vector<Credential> others;
  for (std::size_t i = 0; i < CertificatePool::kMostCertificates; ++i) {
    others.push_back(make_signer(authority_, crypto::PrivateKey(EVP_EC_gen("P-256"))));
    stuffed.enclosed.push_back(others.back().certificate.get());
  }
  EXPECT_EQ(judge_token(make_token(stuffed), expectation, trust).code, TokenCode::kTooDear);
  EXPECT_EQ(CertificatePoolAccess::state_of(pool).certificates.size(), CertificatePool::kMostCertificates);
  EXPECT_EQ(judge_token(known, expectation, trust).code, TokenCode::kValid) << "known ones are judged on";
}

TEST(TokenCodes, HaveEachTheirOwnStableName) {
  EXPECT_EQ(code_name(TokenCode::kValid), "token-valid");
  EXPECT_EQ(code_name(TokenCode::kImprintDiffers), "token-imprint-differs");
  EXPECT_EQ(code_name(TokenCode::kNoTrust), "token-no-trust");
  EXPECT_EQ(verdict_of(TokenCode::kValid), TokenVerdict::kValid);
  EXPECT_EQ(verdict_of(TokenCode::kChainInvalid), TokenVerdict::kRefused);
}

}  // namespace
}  // namespace kiroku::timestamp

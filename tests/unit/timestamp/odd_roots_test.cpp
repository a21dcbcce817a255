// Trust stores as people have them: roots of one name, renewed and expired ones, intermediates beside roots.
// A token that one path proves holds whatever else is trusted, and wrong roots accuse nobody.
#include <gtest/gtest.h>

#include "tests/support/token_maker.h"
#include "timestamp/authority.h"
#include "timestamp/certificate_pool.h"
#include "timestamp/token_verifier.h"

namespace kiroku::timestamp {
namespace {

using test::make_token;
using test::pem_of;
using test::TokenRecipe;

constexpr const char* kYearOfTheToken = "2026";

Certificate copy_of(const Credential& credential) {
  return Certificate(X509_dup(credential.certificate.get()));
}

void remove_extension(X509* certificate, int number) {
  const int at = X509_get_ext_by_NID(certificate, number, -1);
  if (at >= 0) X509_EXTENSION_free(X509_delete_ext(certificate, at));
}

void sign_again(X509* certificate, const Credential& by) {
  ASSERT_GT(X509_sign(certificate, by.key.get(), EVP_sha256()), 0);
}

Credential issue(const std::string& name, CertificateRole role, const Credential* issuer) {
  return issue_certificate(
      {.organisation = "Time",
       .common_name = name,
       .role = role,
       .not_before = *parse_utc("2020-01-01T00:00:00Z"),
       .not_after = *parse_utc("2040-01-01T00:00:00Z"),
       .extended_key_usage = role == CertificateRole::kSigner ? "critical,timeStamping" : ""},
      issuer);
}

/// `of` certified by `by`: the same subject and key.
Certificate certified(const Credential& of, const Credential& by) {
  Certificate out = copy_of(of);
  EXPECT_EQ(X509_set_issuer_name(out.get(), X509_get_subject_name(by.certificate.get())), 1);
  remove_extension(out.get(), NID_authority_key_identifier);
  sign_again(out.get(), by);
  return out;
}

/// As many authorities make them: nothing in it says by which of the keys of a name it was signed.
Credential plain(const std::string& name, CertificateRole role, const Credential& by) {
  Credential made = issue(name, role, nullptr);
  made.certificate = certified(made, by);
  return made;
}

/// The same root with a validity that ended before the token, as a root has it that was renewed.
Certificate expired(const Credential& root) {
  Certificate out = copy_of(root);
  EXPECT_EQ(ASN1_TIME_set_string(X509_getm_notAfter(out.get()), "20250101000000Z"), 1);
  sign_again(out.get(), root);
  return out;
}

Certificate with_extension(const Credential& root, int number, const char* value) {
  Certificate out = copy_of(root);
  remove_extension(out.get(), number);
  const CertificateExtension extension(X509V3_EXT_conf_nid(nullptr, nullptr, number, value));
  EXPECT_EQ(X509_add_ext(out.get(), extension.get(), -1), 1);
  sign_again(out.get(), root);
  return out;
}

class OddRoots : public ::testing::Test {
 protected:
  static TrustStore trusting(const std::vector<X509*>& roots) {
    TrustStore trust;
    for (X509* root : roots) trust.add_trusted(bytes_of(pem_of(root)), "a root");
    return trust;
  }

  static TokenJudgement judge(const Credential& signer, std::vector<X509*> enclosed, const TrustStore& trust,
                              const Expectation& expectation = {}) {
    TokenRecipe recipe;
    recipe.signer = &signer;
    enclosed.insert(enclosed.begin(), signer.certificate.get());
    recipe.enclosed = std::move(enclosed);
    recipe.gen_time = std::string(kYearOfTheToken) + "0805091502Z";
    return judge_token(make_token(recipe), expectation, trust);
  }

  static void expect(const char* code, const TokenJudgement& judgement) {
    EXPECT_EQ(code_name(judgement.code), code) << judgement.explanation;
  }

  Credential root_ = issue("Root", CertificateRole::kAuthority, nullptr);
  Credential signer_ = plain("Signer", CertificateRole::kSigner, root_);
};

/// A signer below an intermediate that its root and an expired root certify.
class CrossCertifiedRoots : public OddRoots {
 protected:
  Credential other_ = issue("Other", CertificateRole::kAuthority, nullptr);
  Certificate other_expired_ = expired(other_);
  Credential between_ = issue("Between", CertificateRole::kAuthority, &root_);
  Certificate cross_ = certified(between_, other_);
  Credential of_between_ = issue("Signer", CertificateRole::kSigner, &between_);
  TrustStore trust_ = trusting({other_expired_.get(), root_.certificate.get()});
  TrustStore wrong_ = trusting({other_expired_.get()});
};

// That nobody vouches for a signer is remembered for all its tokens, so it must not hang on the time of one.
TEST_F(OddRoots, ThatCountLaterAreFoundForLaterTokensOfASignerThatWasAStranger) {
  const Credential signer = issue("Signer", CertificateRole::kSigner, &root_);
  // Of the same name and key, under an identifier that the signer does not name.
  const Certificate useless = with_extension(root_, NID_subject_key_identifier, "01:02:03:04");
  const Certificate later = copy_of(root_);
  ASSERT_EQ(ASN1_TIME_set_string(X509_getm_notBefore(later.get()), "20300101000000Z"), 1);
  sign_again(later.get(), root_);
  for (const std::vector<X509*>& roots :
       {std::vector{useless.get(), later.get()}, std::vector{later.get(), useless.get()}}) {
    const TrustStore trust = trusting(roots);
    CertificatePool pool;
    Expectation expectation;
    expectation.judge_strangers = false;
    expectation.pool = &pool;
    TokenRecipe recipe;
    recipe.signer = &signer;
    recipe.enclosed = {signer.certificate.get()};
    for (const char* year : {"2026", "2027"}) {
      recipe.gen_time = std::string(year) + "0805091502Z";
      EXPECT_EQ(verdict_of(judge_token(make_token(recipe), expectation, trust).code),
                TokenVerdict::kCouldNotCheck);
    }
    recipe.gen_time = "20320805091502Z";
    expect("token-valid", judge_token(make_token(recipe), expectation, trust));
  }
}

TEST_F(OddRoots, OfOneNameAreTakenInAnyOrder) {
  const Credential earlier = issue("Root", CertificateRole::kAuthority, nullptr);
  expect("token-valid", judge(signer_, {}, trusting({earlier.certificate.get(), root_.certificate.get()})));
  expect("token-valid", judge(signer_, {}, trusting({root_.certificate.get(), earlier.certificate.get()})));
}

TEST_F(OddRoots, AnotherOneOfTheSameNameAccusesNobody) {
  const Credential earlier = issue("Root", CertificateRole::kAuthority, nullptr);
  const TokenJudgement judgement = judge(signer_, {}, trusting({earlier.certificate.get()}));
  expect("token-issuer-unknown", judgement);
  EXPECT_EQ(
      judgement.explanation,
      "no certificate that was given signed that of CN=Signer,O=Time, though one has its issuer's name: "
      "give the authority's root and chain");
  // What names its issuer by a key identifier, and was signed by another key, is forged.
  const Credential marked = issue("Marked", CertificateRole::kAuthority, nullptr);
  Credential forged = issue("Signer", CertificateRole::kSigner, &marked);
  sign_again(forged.certificate.get(), earlier);
  expect("token-chain-invalid", judge(forged, {}, trusting({marked.certificate.get()})));
}

TEST_F(OddRoots, ARenewedRootHoldsBesideTheExpiredOne) {
  const Certificate old = expired(root_);
  expect("token-valid", judge(signer_, {}, trusting({old.get(), root_.certificate.get()})));
  expect("token-valid", judge(signer_, {}, trusting({root_.certificate.get(), old.get()})));
  const TokenJudgement judgement = judge(signer_, {}, trusting({old.get()}));
  expect("token-root-not-valid-at-time", judgement);
  EXPECT_EQ(verdict_of(judgement.code), TokenVerdict::kCouldNotCheck);
  EXPECT_EQ(judgement.explanation,
            "the trusted certificate CN=Root,O=Time was not valid at the token's time, "
            "2026-08-05T09:15:02.000000Z: give the root that the authority had then");
}

TEST_F(CrossCertifiedRoots, AnExpiredOneSpoilsNothing) {
  expect("token-valid", judge(of_between_, {cross_.get(), between_.certificate.get()}, trust_));
  expect("token-valid", judge(of_between_, {between_.certificate.get(), cross_.get()}, trust_));
  expect("token-root-not-valid-at-time",
         judge(of_between_, {cross_.get(), between_.certificate.get()}, wrong_));
}

TEST_F(OddRoots, WhatATrustedIntermediateVouchesForHoldsWhateverItsRootSays) {
  const Credential marked = issue("Marked", CertificateRole::kAuthority, nullptr);
  const Credential between = issue("Between", CertificateRole::kAuthority, &marked);
  const Credential signer = issue("Signer", CertificateRole::kSigner, &between);
  const Certificate strict = with_extension(marked, NID_basic_constraints, "critical,CA:TRUE,pathlen:0");
  expect("token-chain-invalid", judge(signer, {between.certificate.get()}, trusting({strict.get()})));
  expect("token-valid",
         judge(signer, {between.certificate.get()}, trusting({strict.get(), between.certificate.get()})));
  expect("token-valid",
         judge(signer, {between.certificate.get()}, trusting({strict.get(), signer.certificate.get()})));
}

// OpenSSL's own path fails for each of these, and what was looked at once costs nothing more.
TEST_F(CrossCertifiedRoots, OfALongCaseAreNotTooDear) {
  CertificatePool pool, of_the_wrong;
  Expectation expectation, with_the_wrong;
  expectation.pool = &pool;
  with_the_wrong.pool = &of_the_wrong;
  TokenRecipe recipe;
  recipe.signer = &of_between_;
  recipe.enclosed = {of_between_.certificate.get(), cross_.get(), between_.certificate.get()};
  recipe.gen_time = std::string(kYearOfTheToken) + "0805091502Z";
  const Bytes token = make_token(recipe);
  for (int i = 0; i < 3'000; ++i) {
    ASSERT_EQ(judge_token(token, expectation, trust_).code, TokenCode::kValid) << i;
    ASSERT_EQ(judge_token(token, with_the_wrong, wrong_).code, TokenCode::kRootNotValidAtTime) << i;
  }
  // Whether it was valid is asked of each time anew.
  recipe.gen_time = "20400201000000Z";
  const TokenJudgement late = judge_token(make_token(recipe), expectation, trust_);
  expect("token-certificate-not-valid-at-time", late);
  recipe.gen_time = "20240201000000Z";
  expect("token-valid", judge_token(make_token(recipe), with_the_wrong, wrong_));
}

// Nobody is accused for what was not looked at: 40 certificates of one intermediate that all have ended.
TEST_F(OddRoots, OfMorePathsThanAreLookedAtNoneAccuses) {
  const Credential between = issue("Between", CertificateRole::kAuthority, &root_);
  const Credential signer = issue("Signer", CertificateRole::kSigner, &between);
  const TrustStore trust = trusting({root_.certificate.get()});
  std::vector<Certificate> certificates;
  std::vector<X509*> enclosed;
  const auto judge_with = [&](int many) {
    while (static_cast<int>(certificates.size()) < many) {
      const auto at = static_cast<long>(certificates.size());
      certificates.push_back(copy_of(between));
      X509* const ended = certificates.back().get();
      ASN1_INTEGER_set(X509_get_serialNumber(ended), 1'000 + at);
      EXPECT_EQ(ASN1_TIME_set_string(X509_getm_notAfter(ended), "20250101000000Z"), 1);
      sign_again(ended, root_);
      enclosed.push_back(ended);
    }
    return judge(signer, enclosed, trust);
  };
  expect("token-certificate-not-valid-at-time", judge_with(20));
  const TokenJudgement judgement = judge_with(40);
  expect("token-too-dear", judgement);
  EXPECT_EQ(verdict_of(judgement.code), TokenVerdict::kCouldNotCheck);
  // Nor by an outside root, where it is the way to the recorder's own that was not looked at to its end.
  TrustStore both;
  both.add_own_authority(bytes_of(pem_of(root_.certificate.get())), "the recorder's own root");
  both.add_trusted(bytes_of(pem_of(certificates.front().get())), "an outside intermediate");
  expect("token-too-dear", judge(signer, enclosed, both));
  // One that holds is enough.
  enclosed.push_back(between.certificate.get());
  expect("token-valid", judge(signer, enclosed, trust));
}

// Whoever holds a trusted key has certificates without end certify each other, and each token is to be judged
// by all of their paths.
TEST_F(OddRoots, WhoCertifiesInCirclesIsNotFollowedWithoutEnd) {
  // All of one name, so that each may have signed each: more pairs than are looked at for one case. Half of
  // them are by the trusted key, and half by another one.
  constexpr std::size_t kOfEach = 100;
  const Credential stranger = issue("Root", CertificateRole::kAuthority, nullptr);
  std::vector<Certificate> certificates;
  std::vector<X509*> enclosed;
  for (std::size_t i = 0; i < kOfEach; ++i) {
    for (const Credential* by : {static_cast<const Credential*>(&root_), &stranger}) {
      certificates.push_back(certified(issue("Root", CertificateRole::kAuthority, nullptr), *by));
      enclosed.push_back(certificates.back().get());
    }
  }
  TrustStore trust;
  trust.add_own_authority(bytes_of(pem_of(root_.certificate.get())), "the recorder's own root");
  CertificatePool pool;
  Expectation expectation;
  expectation.pool = &pool;
  for (int i = 0; i < 3; ++i) {
    expect("token-too-dear",
           judge(plain("Signer", CertificateRole::kSigner, stranger), enclosed, trust, expectation));
  }
  // Outside ones are looked for with what is theirs.
  const Credential outside = issue("Outside", CertificateRole::kAuthority, nullptr);
  const Certificate old = expired(outside);
  const Credential earlier = issue("Outside", CertificateRole::kAuthority, nullptr);
  trust.add_trusted(
      bytes_of(pem_of(earlier.certificate.get()) + pem_of(old.get()) + pem_of(outside.certificate.get())),
      "outside roots");
  expect("token-valid",
         judge(plain("Signer", CertificateRole::kSigner, outside), enclosed, trust, expectation));
}

}  // namespace
}  // namespace kiroku::timestamp

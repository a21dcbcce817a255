#include "timestamp/own_authority.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"
#include "tests/support/token_maker.h"
#include "timestamp/authority.h"
#include "timestamp/request.h"
#include "timestamp/token_verifier.h"

namespace kiroku::timestamp {
namespace {

using test::make_test_authority;
using test::make_token;
using test::pem_of;
using test::TestAuthority;
using test::TokenRecipe;
using testing::ElementsAre;
using testing::IsEmpty;

class OwnAuthority : public ::testing::Test {
 protected:
  static Credential issue(const std::string& name, CertificateRole role, const Credential* issuer) {
    return issue_certificate(
        {.organisation = "Test",
         .common_name = name,
         .role = role,
         .not_before = *parse_utc("2020-01-01T00:00:00Z"),
         .not_after = *parse_utc("2040-01-01T00:00:00Z"),
         .extended_key_usage = role == CertificateRole::kSigner ? "critical,timeStamping" : ""},
        issuer);
  }
  static void trust(TrustStore& store, const Credential& root) {
    store.add_trusted(bytes_of(pem_of(root.certificate.get())), "an outside root");
  }
  static void own(TrustStore& store, const Credential& root) {
    store.add_own_authority(bytes_of(pem_of(root.certificate.get())), "the recorder's own root");
  }
  static TokenJudgement judge(const Credential& signer, std::vector<X509*> enclosed, const TrustStore& store,
                              const std::string& policy = "1.2.3.4") {
    TokenRecipe recipe;
    recipe.signer = &signer;
    enclosed.insert(enclosed.begin(), signer.certificate.get());
    recipe.enclosed = std::move(enclosed);
    recipe.policy = policy;
    return judge_token(make_token(recipe), {}, store);
  }
  static void expect(TimeAuthority authority, const TokenJudgement& judgement) {
    EXPECT_EQ(code_name(judgement.code), "token-valid") << judgement.explanation;
    EXPECT_EQ(judgement.authority, authority);
  }
  /// `of` certified once more by another issuer: the same subject, the same key.
  static Certificate cross_signed(const Credential& of, const Credential& issuer) {
    Certificate out(X509_dup(of.certificate.get()));
    EXPECT_EQ(X509_set_issuer_name(out.get(), X509_get_subject_name(issuer.certificate.get())), 1);
    // What it says of its issuer's key identifier, if anything, is of the old one.
    const int at = X509_get_ext_by_NID(out.get(), NID_authority_key_identifier, -1);
    if (at >= 0) X509_EXTENSION_free(X509_delete_ext(out.get(), at));
    EXPECT_GT(X509_sign(out.get(), issuer.key.get(), EVP_sha256()), 0);
    return out;
  }

  TestAuthority home_ = make_test_authority();  // nothing in its certificates tells whose it is
  Credential outside_ = issue("Outside root", CertificateRole::kAuthority, nullptr);
};

TEST_F(OwnAuthority, IsToldByTheRootThatThePathEndsAt) {
  TrustStore both;
  own(both, home_.ca);
  trust(both, outside_);
  const TokenJudgement judgement = judge(home_.signer, {}, both);
  expect(TimeAuthority::kOwn, judgement);
  ASSERT_EQ(judgement.chain.size(), 2U);
  EXPECT_EQ(judgement.chain.back(), encode_with<i2d_X509>(home_.ca.certificate.get()));
  expect(TimeAuthority::kOutside,
         judge(issue("Outside signer", CertificateRole::kSigner, &outside_), {}, both));
}

TEST_F(OwnAuthority, OfARootThatIsAlsoTrustedAsOutsideIsOwn) {
  TrustStore both;
  trust(both, home_.ca);
  own(both, home_.ca);
  expect(TimeAuthority::kOwn, judge(home_.signer, {}, both));
  EXPECT_THAT(both.own_among_outside(), ElementsAre("CN=Test root,O=Test"));
}

TEST_F(OwnAuthority, IsToldByItsKeyUnderAnotherNameAndRoot) {
  // An outside CA certified the key of the recorder's own.
  const Certificate cross = cross_signed(home_.ca, outside_);
  TrustStore both;
  trust(both, outside_);
  own(both, home_.ca);
  expect(TimeAuthority::kOwn, judge(home_.signer, {cross.get()}, both));
  // Whoever does not know the recorder's own root has the outside CA's word, and that it is trusted.
  TrustStore outside_alone;
  trust(outside_alone, outside_);
  expect(TimeAuthority::kOutside, judge(home_.signer, {cross.get()}, outside_alone));
  // Under another subject no path leads to the own root, and the key is still the same.
  Credential renamed = issue("National root", CertificateRole::kAuthority, nullptr);
  ASSERT_EQ(X509_set_pubkey(renamed.certificate.get(), home_.ca.key.get()), 1);
  ASSERT_GT(X509_sign(renamed.certificate.get(), home_.ca.key.get(), EVP_sha256()), 0);
  renamed.key.reset(home_.ca.key.get());
  EVP_PKEY_up_ref(home_.ca.key.get());
  TrustStore handed_over;
  trust(handed_over, renamed);
  own(handed_over, home_.ca);
  expect(TimeAuthority::kOwn,
         judge(issue("National signer", CertificateRole::kSigner, &renamed), {}, handed_over));
}

TEST_F(OwnAuthority, CountsWhereAPathLeadsToBothKinds) {
  // An intermediate under the own root, certified by an outside one, too; whichever certificate comes first.
  const Credential between = issue("Between", CertificateRole::kAuthority, &home_.ca);
  const Credential signer = issue("Between signer", CertificateRole::kSigner, &between);
  const Certificate cross = cross_signed(between, outside_);
  TrustStore both;
  trust(both, outside_);
  own(both, home_.ca);
  expect(TimeAuthority::kOwn, judge(signer, {between.certificate.get(), cross.get()}, both));
  expect(TimeAuthority::kOwn, judge(signer, {cross.get(), between.certificate.get()}, both));
}

TEST_F(OwnAuthority, MayBeGivenByAnIntermediateOrTheSignerItself) {
  const Credential between = issue("Between", CertificateRole::kAuthority, &outside_);
  const Credential signer = issue("Between signer", CertificateRole::kSigner, &between);
  TrustStore intermediate;
  trust(intermediate, outside_);
  own(intermediate, between);
  expect(TimeAuthority::kOwn, judge(signer, {between.certificate.get()}, intermediate));
  TrustStore leaf;
  trust(leaf, outside_);
  own(leaf, signer);
  expect(TimeAuthority::kOwn, judge(signer, {between.certificate.get()}, leaf));
  // And an outside one by an intermediate.
  TrustStore outside;
  trust(outside, between);
  own(outside, home_.ca);
  expect(TimeAuthority::kOutside, judge(signer, {}, outside));
}

TEST_F(OwnAuthority, AddedAsOutsideIsToldByTheNameThatEveryEmbeddedAuthorityHas) {
  const test::TemporaryFolder folder;
  const Authority embedded = Authority::create(folder / "authority", "or-3");
  TrustStore mistaken;
  mistaken.add_trusted(bytes_of(embedded.root_pem()), "trust.pem of an older home");
  EXPECT_THAT(mistaken.own_among_outside(), ElementsAre("CN=Kiroku embedded time-stamping CA,O=or-3"));
  TrustStore by_signer;
  by_signer.add_trusted(bytes_of(embedded.chain_pem()), "signer and CA");
  EXPECT_EQ(by_signer.own_among_outside().size(), 2U);
  TrustStore outside;
  trust(outside, outside_);
  own(outside, home_.ca);
  EXPECT_THAT(outside.own_among_outside(), IsEmpty());
}

TEST_F(OwnAuthority, OfThePolicyOfEmbeddedAuthoritiesIsOwn) {
  TrustStore outside;
  trust(outside, home_.ca);
  expect(TimeAuthority::kOwn, judge(home_.signer, {}, outside, std::string(kEmbeddedPolicy)));
  expect(TimeAuthority::kOutside, judge(home_.signer, {}, outside));
}

TEST_F(OwnAuthority, WasThereBeforeItWasMadeAnew) {
  const test::TemporaryFolder folder;
  const Authority earlier = Authority::create(folder / "earlier", "or-3");
  const Authority later = Authority::create(folder / "later", "or-3");
  TrustStore both;
  both.add_own_authority(bytes_of(earlier.root_pem() + later.root_pem()), "own-authority.pem");
  const Request request = make_request(crypto::HashAlgorithm::kSha256, Bytes(32, std::byte{1}));
  for (const char* name : {"earlier", "later"}) {
    Authority authority = Authority::open(folder / name);
    expect(TimeAuthority::kOwn, judge_token(authority.respond(encode_request(request)), {}, both));
  }
}

TEST_F(OwnAuthority, DoesNotHideWhatSpeaksAgainstAToken) {
  // Not valid yet when its root says it was: refused, though an outside root that is given knows nothing.
  TrustStore both;
  trust(both, outside_);
  own(both, home_.ca);
  TokenRecipe early;
  early.signer = &home_.signer;
  early.enclosed = {home_.signer.certificate.get()};
  early.gen_time = "20190805091502Z";
  EXPECT_EQ(code_name(judge_token(make_token(early), {}, both).code), "token-certificate-not-valid-at-time");
  const Credential stranger = issue("Stranger", CertificateRole::kAuthority, nullptr);
  EXPECT_EQ(code_name(judge(issue("Stranger's", CertificateRole::kSigner, &stranger), {}, both).code),
            "token-issuer-unknown");
}

}  // namespace
}  // namespace kiroku::timestamp

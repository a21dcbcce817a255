// Whoever holds the keys of the recorder's own authority wants its tokens to be taken for outside time.
#include <array>
#include <cstdio>
#include <ctime>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/pem.h>

#include "archive/reading/excerpt.h"
#include "tests/attack/attacked_case.h"
#include "tests/support/report_text.h"
#include "tests/support/token_maker.h"
#include "timestamp/authority.h"

namespace kiroku::test {
namespace {

using archive::TimeProof;
using timestamp::CertificateRole;
using timestamp::Credential;
using timestamp::TrustStore;

/// Of a key holder's tokens, to look like a national institute's.
constexpr const char* kForeignPolicy = "1.2.3.4";

Credential read_credential(const std::filesystem::path& folder, const std::string& name) {
  const std::string key = read_file(folder / (name + ".key"));
  const std::string certificate = read_file(folder / (name + ".pem"));
  const timestamp::BioHandle key_in(BIO_new_mem_buf(key.data(), static_cast<int>(key.size())));
  const timestamp::BioHandle certificate_in(
      BIO_new_mem_buf(certificate.data(), static_cast<int>(certificate.size())));
  return {crypto::PrivateKey(PEM_read_bio_PrivateKey(key_in.get(), nullptr, nullptr, nullptr)),
          timestamp::Certificate(PEM_read_bio_X509(certificate_in.get(), nullptr, nullptr, nullptr))};
}

/// GeneralizedTime with milliseconds, as RFC 3161 wants it.
std::string gen_time_of(UtcTime time) {
  const auto whole = std::chrono::floor<std::chrono::seconds>(time);
  const std::time_t seconds = whole.time_since_epoch().count();
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y%m%d%H%M%S", &parts);
  std::string out = text.data();
  const auto tenths = std::chrono::duration_cast<std::chrono::milliseconds>(time - whole).count() / 100;
  if (tenths > 0) out += "." + std::to_string(tenths);
  return out + "Z";
}

/// A granted response of `signer` over a note, under any policy, at any time.
Bytes answer_of(const Credential& signer, const std::vector<X509*>& enclosed, const std::string& policy,
                const std::string& note, UtcTime time) {
  TokenRecipe recipe;
  const crypto::Sha256Digest imprint = crypto::sha256(bytes_of(note));
  recipe.imprint = Bytes(imprint.begin(), imprint.end());
  recipe.gen_time = gen_time_of(time);
  recipe.policy = policy;
  recipe.signer = &signer;
  recipe.enclosed = enclosed;
  return make_response(make_token(recipe));
}

Credential issue(const std::string& organisation, const std::string& name, CertificateRole role,
                 const Credential& issuer) {
  return timestamp::issue_certificate(
      {.organisation = organisation,
       .common_name = name,
       .role = role,
       .not_before = *parse_utc("2020-01-01T00:00:00Z"),
       .not_after = *parse_utc("2040-01-01T00:00:00Z"),
       .extended_key_usage = role == CertificateRole::kSigner ? "critical,timeStamping" : ""},
      &issuer);
}

class AttackByTheOwnAuthority : public ::testing::Test {
 protected:
  AttackByTheOwnAuthority() {
    own_.add_own_authority(bytes_of(archive_.authority().root_pem()), "the recorder's own authority");
    mistaken_.add_trusted(bytes_of(archive_.authority().root_pem()), "trusted as an outside one");
    // Half a day back: what is claimed to have been recorded then.
    archive_.authority_time = [](std::int64_t mono_ns) {
      return SampleArchive::opened_at() - std::chrono::hours(12) +
             std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::nanoseconds(mono_ns));
    };
  }

  void stamp_as(const Credential& signer, std::vector<X509*> enclosed) {
    archive_.authority_answer = [&signer, enclosed](const std::string& note, UtcTime time) {
      return answer_of(signer, enclosed, kForeignPolicy, note, time);
    };
  }

  [[nodiscard]] archive::VerificationReport verify(const std::filesystem::path& folder,
                                                   const TrustStore& trust) const {
    archive::VerifyOptions options = archive_.options();
    options.trust = &trust;
    return archive::verify_case(folder, options);
  }

  /// A case stamped as stamp_as() says is intact and its time self-issued, also where the root was trusted as
  /// an outside one.
  void expect_self_issued() {
    const std::filesystem::path folder = SampleCase::write(archive_);
    for (const TrustStore* trust : {&own_, &mistaken_}) {
      const archive::VerificationReport report = verify(folder, *trust);
      EXPECT_EQ(summary(report), "intact") << details(report);
      EXPECT_EQ(archive::time_proof_name(report.time), "self-issued");
    }
  }

  SampleArchive archive_;
  TrustStore own_, mistaken_;
  Credential ca_ = read_credential(archive_.authority_folder(), "ca");
  Credential tsa_ = read_credential(archive_.authority_folder(), "tsa");
};

TEST_F(AttackByTheOwnAuthority, UnderAForeignPolicyIsSelfIssued) {
  stamp_as(tsa_, {tsa_.certificate.get(), ca_.certificate.get()});
  expect_self_issued();
}

TEST_F(AttackByTheOwnAuthority, WithANewSignerUnderAFamousNameIsSelfIssued) {
  const Credential famous =
      issue("National Institute of Standards", "National time", CertificateRole::kSigner, ca_);
  stamp_as(famous, {famous.certificate.get(), ca_.certificate.get()});
  expect_self_issued();
}

// Which root was given is the verifier's choice: one that had expired by then says nothing against the case.
TEST_F(AttackByTheOwnAuthority, UnderARootThatHadExpiredByThenAccusesNobody) {
  const std::filesystem::path folder = SampleCase::write(archive_);
  const timestamp::Certificate expired(X509_dup(ca_.certificate.get()));
  ASSERT_EQ(ASN1_TIME_set_string(X509_getm_notBefore(expired.get()), "20100101000000Z"), 1);
  ASSERT_EQ(ASN1_TIME_set_string(X509_getm_notAfter(expired.get()), "20150101000000Z"), 1);
  ASSERT_GT(X509_sign(expired.get(), ca_.key.get(), EVP_sha256()), 0);
  TrustStore old;
  old.add_own_authority(bytes_of(pem_of(expired.get())), "a root of then");
  const archive::VerificationReport report = verify(folder, old);
  EXPECT_EQ(archive::verdict_name(report.verdict), "unproven") << details(report);
  EXPECT_THAT(details(report), ::testing::HasSubstr("give the root that the authority had then"));
  // Beside its successor it changes nothing.
  old.add_own_authority(bytes_of(archive_.authority().root_pem()), "the root of now");
  EXPECT_EQ(summary(verify(folder, old)), "intact");
}

TEST_F(AttackByTheOwnAuthority, ThroughAnIntermediateIsSelfIssued) {
  const Credential between =
      issue("National Institute of Standards", "National CA", CertificateRole::kAuthority, ca_);
  const Credential famous =
      issue("National Institute of Standards", "National time", CertificateRole::kSigner, between);
  stamp_as(famous, {famous.certificate.get(), between.certificate.get()});
  expect_self_issued();
}

TEST_F(AttackByTheOwnAuthority, UnderARootOfItsOwnKeyWithAnotherNameProvesNothing) {
  Credential renamed{crypto::PrivateKey(), timestamp::Certificate(X509_dup(ca_.certificate.get()))};
  EVP_PKEY_up_ref(ca_.key.get());
  renamed.key.reset(ca_.key.get());
  const timestamp::CertificateName name(X509_NAME_new());
  X509_NAME_add_entry_by_txt(name.get(), "CN", MBSTRING_ASC,
                             reinterpret_cast<const unsigned char*>("National root"), -1, -1, 0);
  ASSERT_EQ(X509_set_subject_name(renamed.certificate.get(), name.get()), 1);
  ASSERT_EQ(X509_set_issuer_name(renamed.certificate.get(), name.get()), 1);
  ASSERT_GT(X509_sign(renamed.certificate.get(), renamed.key.get(), EVP_sha256()), 0);
  const Credential famous =
      issue("National Institute of Standards", "National time", CertificateRole::kSigner, renamed);
  stamp_as(famous, {famous.certificate.get(), renamed.certificate.get()});
  const std::filesystem::path folder = SampleCase::write(archive_);
  const archive::VerificationReport report = verify(folder, own_);
  EXPECT_EQ(archive::verdict_name(report.verdict), "unproven") << details(report);
  EXPECT_EQ(archive::time_proof_name(report.time), "none");
  // Whoever took that root for an outside one still sees by its key whose it is.
  TrustStore taken_in;
  taken_in.add_own_authority(bytes_of(archive_.authority().root_pem()), "the recorder's own authority");
  taken_in.add_trusted(bytes_of(pem_of(renamed.certificate.get())), "a root that somebody handed over");
  EXPECT_EQ(archive::time_proof_name(verify(folder, taken_in).time), "self-issued");
}

/// A case with a true outside token over its first checkpoint, and the recorder's own tokens after it.
class AttackBesideAnOutsideAuthority : public AttackByTheOwnAuthority {
 protected:
  AttackBesideAnOutsideAuthority() {
    own_.add_trusted(bytes_of(outside_.root_pem()), "an outside authority");
    archive_.authority_time = [](std::int64_t mono_ns) {
      return SampleArchive::opened_at() +
             std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::nanoseconds(mono_ns));
    };
    stamp_as(tsa_, {tsa_.certificate.get(), ca_.certificate.get()});
  }

  /// Checkpoint and token of the outside authority, whose clock is right; the recorder's may be behind it.
  void stamp_outside(SampleCase& sample, std::chrono::seconds behind = std::chrono::seconds(0)) {
    const archive::StoredCheckpoint checkpoint = sample.writer().checkpoint(archive_.now(), true);
    const std::int64_t asked_ns = archive_.now_ns;
    archive_.now_ns += 100'000'000;
    const Bytes response = answer_of(outside_.signer, {outside_.signer.certificate.get()}, kForeignPolicy,
                                     checkpoint.note, archive_.now().utc + behind);
    archive_.now_ns += 100'000'000;
    archive::TokenEntry facts = SampleArchive::facts_of(response);
    facts.exchange = archive::TokenEntry::Exchange{asked_ns, archive_.now_ns};
    sample.writer().add_token(checkpoint, "outside", response, facts, archive_.now());
  }

  TestAuthority outside_ = make_test_authority();
};

// Whoever slows the recorder's clock makes its own tokens contradict the outside ones: that is no tampering.
TEST_F(AttackBesideAnOutsideAuthority, ARecordersClockThatIsBehindMakesNoSoundCaseTampered) {
  for (const auto behind : {std::chrono::seconds(20), std::chrono::seconds(180)}) {
    SampleCase sample(archive_);
    stamp_outside(sample, behind);
    sample.record();
    sample.close();
    const archive::VerificationReport report = verify(sample.folder(), own_);
    EXPECT_EQ(report.verdict, archive::Verdict::kIntact) << details(report);
  }
}

/// Two outside authorities, one after the other: the second covers the entry of the first one's token.
class TwoOutsideAuthorities : public AttackBesideAnOutsideAuthority {
 protected:
  TwoOutsideAuthorities() { own_.add_trusted(bytes_of(second_.root_pem()), "another outside authority"); }
  void stamp(SampleCase& sample, const TestAuthority& authority, const std::string& name, UtcTime says) {
    const archive::StoredCheckpoint checkpoint = sample.writer().checkpoint(archive_.now(), true);
    const Bytes response = answer_of(authority.signer, {authority.signer.certificate.get()}, kForeignPolicy,
                                     checkpoint.note, says);
    sample.writer().add_token(checkpoint, name, response, SampleArchive::facts_of(response), archive_.now());
  }
  /// At 0.3 s of the case; the second authority says so much less than the first.
  archive::VerificationReport verify_with(std::chrono::milliseconds less) {
    SampleCase sample(archive_);
    archive_.now_ns = 300'000'000;
    const UtcTime now = archive_.now().utc;
    stamp(sample, outside_, "outside", now);
    stamp(sample, second_, "second", now - less);
    sample.record();
    sample.close();
    return verify(sample.folder(), own_);
  }
  TestAuthority second_ = make_test_authority();
};

TEST_F(TwoOutsideAuthorities, OfWhichOneStatesWholeSecondsDoNotContradictEachOther) {
  for (const int less : {300, 1000}) {
    const archive::VerificationReport report = verify_with(std::chrono::milliseconds(less));
    EXPECT_EQ(report.verdict, archive::Verdict::kIntact) << details(report);
    for (const archive::Bracket& bracket : report.brackets) {
      if (bracket.not_before && bracket.not_after) {
        EXPECT_LE(*bracket.not_before, *bracket.not_after);
      }
    }
  }
}

TEST_F(TwoOutsideAuthorities, WhoseClocksContradictEachOtherProveNoTime) {
  const archive::VerificationReport report = verify_with(std::chrono::seconds(10));
  EXPECT_EQ(report.verdict, archive::Verdict::kUnproven) << details(report);
  EXPECT_THAT(summary(report), testing::HasSubstr("authorities-disagree tokens/"));
}

TEST_F(AttackBesideAnOutsideAuthority, TheOwnTokensMakeNoBracketsOfOutsideTime) {
  SampleCase sample(archive_);
  stamp_outside(sample);
  sample.record();
  sample.close();
  const archive::VerificationReport report = verify(sample.folder(), own_);
  EXPECT_EQ(summary(report), "intact") << details(report);
  ASSERT_FALSE(report.brackets.empty());
  for (const archive::Bracket& bracket : report.brackets) {
    EXPECT_THAT(bracket.authority_before, testing::AnyOf("", "outside"));
    EXPECT_THAT(bracket.authority_after, testing::AnyOf("", "outside"));
  }
  EXPECT_FALSE(report.brackets.back().not_after) << "nobody outside saw the end";
}

TEST_F(AttackBesideAnOutsideAuthority, AnOutsideTokenOverTheBeginningDoesNotProveTheRest) {
  SampleCase sample(archive_);
  stamp_outside(sample);
  sample.record();
  sample.close();
  const archive::VerificationReport report = verify(sample.folder(), own_);
  EXPECT_EQ(archive::time_proof_name(report.time), "external-in-part") << details(report);
}

// The own tokens before the end say when it was recorded, and only the recorder stands behind them.
TEST_F(AttackBesideAnOutsideAuthority, AnOutsideTokenOverTheEndProvesThatTheWholeWasThereByThen) {
  SampleCase sample(archive_);
  sample.record();
  archive_.now_ns = 7'000'000'000;
  sample.writer().close("operator", archive_.now());
  stamp_outside(sample);
  sample.writer().finish(archive_.now());
  const archive::VerificationReport report = verify(sample.folder(), own_);
  EXPECT_THAT(summary(report), testing::StartsWith("intact\nstamped-after-close tokens/")) << details(report);
  EXPECT_EQ(archive::time_proof_name(report.time), "external");
}

// An operation that was played again a week later, on a clock set back: the times are the token's.
TEST_F(AttackBesideAnOutsideAuthority, ARecordersClockThatIsAWeekBehindIsSaid) {
  const auto stamped = [this](std::chrono::seconds behind) {
    SampleCase sample(archive_);
    stamp_outside(sample, behind);
    archive_.now_ns = 7'000'000'000;
    sample.record_at_once();
    sample.writer().close("operator", archive_.now());
    stamp_outside(sample, behind);
    sample.writer().finish(archive_.now());
    std::filesystem::remove(sample.folder() / "authorities/embedded.pem");  // no entry names it
    return verify(sample.folder(), own_);
  };
  const archive::VerificationReport report = stamped(std::chrono::hours(24 * 7));
  EXPECT_EQ(summary(report), "intact\nclock-differs ledger.jsonl 0") << details(report);
  EXPECT_THAT(details(report), testing::HasSubstr("604800 s behind"));
  EXPECT_EQ(summary(stamped(std::chrono::seconds(30))), "intact");
}

TEST_F(AttackBesideAnOutsideAuthority, AnExcerptBetweenOwnTokensReachesToTheOutsideOnes) {
  SampleCase sample(archive_);
  stamp_outside(sample);
  sample.record();
  archive_.now_ns = 7'000'000'000;
  sample.writer().close("operator", archive_.now());
  sample.stamp();
  stamp_outside(sample);
  sample.writer().finish(archive_.now());
  archive::ExcerptOptions options;
  options.from_ns = 2'000'000'001;
  options.to_ns = 4'000'000'000;
  options.streams = {"endoscope"};
  archive::make_excerpt(sample.folder(), options, archive_.folder() / "excerpt");
  const archive::VerificationReport report = verify(archive_.folder() / "excerpt", own_);
  EXPECT_EQ(summary(report), "intact-excerpt") << details(report);
  EXPECT_EQ(archive::time_proof_name(report.time), "external");
  for (const archive::Bracket& bracket : report.brackets) {
    EXPECT_THAT(bracket.authority_before, testing::AnyOf("", "outside"));
    EXPECT_THAT(bracket.authority_after, testing::AnyOf("", "outside"));
  }
}

}  // namespace
}  // namespace kiroku::test

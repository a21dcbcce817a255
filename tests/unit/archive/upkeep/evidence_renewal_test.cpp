#include "archive/upkeep/evidence_renewal.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/verify/case_evidence.h"
#include "archive/verify/verifier.h"
#include "base/error.h"
#include "tests/support/evidence_kit.h"
#include "tests/support/sample_case.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::day;
using test::PlayedAuthority;
using ::testing::HasSubstr;
using What = EvidenceRenewal::What;

class EvidenceRenewalTest : public ::testing::Test {
 protected:
  EvidenceRenewalTest() {
    trust_.add_own_authority(bytes_of(archive_.authority().root_pem()), "own");
    trust_.add_trusted(bytes_of(first_.root_pem()), "first");
    trust_.add_trusted(bytes_of(second_.root_pem()), "second");
    cases_ = {test::SampleCase::write(archive_), test::SampleCase::write(archive_)};
  }
  [[nodiscard]] EvidenceRenewalOptions at(const std::string& today, const PlayedAuthority& authority,
                                          const std::string& policy = "") const {
    EvidenceRenewalOptions options{.trust = &trust_, .now = day(today), .stamp = authority.at(today)};
    if (!policy.empty()) options.policy = evidence::Policy::parse(policy, "policy.toml");
    return options;
  }
  std::vector<EvidenceRenewal> renew(const EvidenceRenewalOptions& options) const {
    return renew_evidence(real_file_system(), cases_, options);
  }
  [[nodiscard]] VerificationReport verify(const fs::path& folder, const std::string& today,
                                          const evidence::Policy* policy = nullptr) const {
    VerifyOptions options = archive_.options();
    options.trust = &trust_;
    options.now = day(today);
    options.policy = policy;
    return verify_case(folder, options);
  }
  [[nodiscard]] fs::path record_of(const fs::path& folder) const {
    return evidence_file(folder, folder.filename().string());
  }
  static std::string told(const VerificationReport& report, const std::string& code) {
    for (const Finding& finding : report.findings) {
      if (finding.code == code) return finding.text;
    }
    return "";
  }
  static constexpr const char* kPolicy = R"(
new_hash = "sha512"
[[algorithm]]
name = "sha256"
until = 2039-12-31
[[algorithm]]
name = "sha512"
[[algorithm]]
name = "ecdsa"
[[algorithm]]
name = "ed25519"
until = 2039-12-31
)";

  test::SampleArchive archive_;
  PlayedAuthority first_{"First", "2026-01-01", "2034-01-01"};
  PlayedAuthority second_{"Second", "2030-01-01", "2050-01-01"};
  timestamp::TrustStore trust_;
  std::vector<fs::path> cases_;
};

TEST_F(EvidenceRenewalTest, OneTokenForAllCasesProvesEachOfThem) {
  const auto results = renew(at("2027-01-01", first_));
  ASSERT_EQ(results.size(), 2U);
  EXPECT_EQ(results[0].what, What::kBegun) << results[0].text;
  EXPECT_EQ(results[1].what, What::kBegun) << results[1].text;
  for (const fs::path& folder : cases_) {
    const VerificationReport report = verify(folder, "2028-01-01");
    EXPECT_EQ(report.verdict, Verdict::kIntact);
    ASSERT_TRUE(report.evidence);
    EXPECT_TRUE(report.evidence->holds) << report.evidence->refusal;
    EXPECT_TRUE(report.evidence->outside);
    EXPECT_EQ(report.evidence->since, day("2027-01-01"));
    EXPECT_EQ(report.evidence->entries, report.entries);
    // Notes, tokens, segments, subject: all that is there but the ledger, device.pub and certificates.
    std::uint64_t files = 0;
    for (const auto& each : fs::recursive_directory_iterator(folder)) {
      const std::string name = fs::relative(each.path(), folder).string();
      files += each.is_regular_file() && name != "ledger.jsonl" && name != "device.pub" &&
                       !name.starts_with("authorities/")
                   ? 1U
                   : 0U;
    }
    EXPECT_EQ(report.evidence->files, files);
  }
  EXPECT_EQ(renew(at("2027-02-01", first_))[0].what, What::kNothingDue);
}

TEST_F(EvidenceRenewalTest, TwentyYearsOfACaseEndWithItsProof) {
  const evidence::Policy policy = evidence::Policy::parse(kPolicy, "policy.toml");
  renew(at("2027-01-01", first_));
  const auto stamped = renew(at("2033-10-01", second_, kPolicy));
  EXPECT_EQ(stamped[0].what, What::kTimeStampRenewed) << stamped[0].text;
  EXPECT_THAT(stamped[0].text, HasSubstr("a certificate of CN=First"));
  const auto hashed = renew(at("2039-10-01", second_, kPolicy));
  EXPECT_EQ(hashed[0].what, What::kHashTreeRenewed) << hashed[0].text;
  EXPECT_EQ(hashed[0].text, "sha256 ends at 2040-01-01T00:00:00.000000Z");
  // The tokens of these authorities are signed over SHA-256, which ended: so the policy names another end for
  // that.
  const evidence::Policy none = evidence::Policy::without_ends();
  const VerificationReport report = verify(cases_[0], "2046-01-01", &none);
  EXPECT_EQ(report.verdict, Verdict::kIntact);
  ASSERT_TRUE(report.evidence);
  EXPECT_TRUE(report.evidence->holds) << report.evidence->refusal;
  EXPECT_EQ(report.evidence->time_stamps, 3U);
  EXPECT_EQ(report.evidence->hashes, (std::vector<std::string>{"sha256", "sha512"}));
  EXPECT_THAT(told(report, "evidence-holds"),
              HasSubstr("a chain of 3 time-stamps, the newest of 2039-10-01"));
}

// What signed something that ended proves nothing by itself. A record that began before still does.
TEST_F(EvidenceRenewalTest, AnAlgorithmThatEndedLeavesACaseWithoutRecordUnproven) {
  const evidence::Policy ended = evidence::Policy::parse(
      "[[algorithm]]\nname=\"sha256\"\n[[algorithm]]\nname=\"ecdsa\"\n[[algorithm]]\nname=\"ed25519\"\n"
      "until=2029-12-31\n",
      "policy.toml");
  EXPECT_EQ(verify(cases_[0], "2029-06-01", &ended).verdict, Verdict::kIntact);
  const VerificationReport without = verify(cases_[0], "2031-01-01", &ended);
  EXPECT_EQ(without.verdict, Verdict::kUnproven);
  EXPECT_THAT(told(without, "algorithm-ended"),
              HasSubstr("ed25519, on which this case rests, ended at 2030-01-01"));
  renew(at("2027-01-01", first_));
  EXPECT_EQ(verify(cases_[0], "2031-01-01", &ended).verdict, Verdict::kIntact);
  // One that began after that proves only what was there then.
  fs::remove(record_of(cases_[0]));
  renew(at("2030-06-01", first_));
  EXPECT_EQ(verify(cases_[0], "2031-01-01", &ended).verdict, Verdict::kUnproven);
}

TEST_F(EvidenceRenewalTest, WhatCannotBeReadIsNamedAndNothingIsDoneForThatCase) {
  const fs::path segment = cases_[0] / "segments/endoscope/00000000.ts.age";
  fs::resize_file(segment, fs::file_size(segment) - 1);
  const auto results = renew(at("2027-01-01", first_));
  EXPECT_EQ(results[0].what, What::kRefused);
  EXPECT_THAT(results[0].text, HasSubstr("segments/endoscope/00000000.ts.age"));
  EXPECT_FALSE(fs::exists(record_of(cases_[0])));
  EXPECT_EQ(results[1].what, What::kBegun) << results[1].text;
  EXPECT_EQ(verify(cases_[1], "2028-01-01").verdict, Verdict::kIntact);
}

TEST_F(EvidenceRenewalTest, WithoutAnAuthorityNoRecordIsWritten) {
  EvidenceRenewalOptions options = at("2027-01-01", first_);
  options.stamp = [](crypto::HashAlgorithm, ByteView) -> Bytes { throw Error("nobody answers"); };
  EXPECT_THROW(renew(options), Error);
  EXPECT_FALSE(fs::exists(record_of(cases_[0])));
  options.dry_run = true;
  EXPECT_EQ(renew(options)[0].what, What::kBegun);
  EXPECT_FALSE(fs::exists(record_of(cases_[0])));
}

TEST_F(EvidenceRenewalTest, ARecordThatDoesNotHoldIsLeftAsItIs) {
  renew(at("2027-01-01", first_));
  fs::copy_file(record_of(cases_[1]), record_of(cases_[0]), fs::copy_options::overwrite_existing);
  const auto results = renew(at("2033-10-01", second_));
  EXPECT_EQ(results[0].what, What::kRefused);
  EXPECT_THAT(results[0].text, HasSubstr("it does not cover the ledger of this case"));
  EXPECT_EQ(results[1].what, What::kTimeStampRenewed) << results[1].text;
  EXPECT_EQ(renew(at("2034-06-01", second_))[1].what, What::kNothingDue);
}

TEST_F(EvidenceRenewalTest, ARecordThatLapsedIsNotRenewed) {
  renew(at("2027-01-01", first_));
  const auto results = renew(at("2034-06-01", second_));
  EXPECT_EQ(results[0].what, What::kRefused);
  EXPECT_THAT(results[0].text, HasSubstr("nothing renewed it before"));
}

}  // namespace
}  // namespace kiroku::archive

#include "archive/upkeep/evidence_renewal.h"

#include <fstream>
#include <map>
#include <memory>
#include <mutex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/verify/case_evidence.h"
#include "archive/verify/verifier.h"
#include "base/error.h"
#include "tests/support/case_kit.h"
#include "tests/support/evidence_kit.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/sample_case.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::day;
using test::PlayedAuthority;
using ::testing::HasSubstr;
using ::testing::Not;
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
    EvidenceRenewalOptions options;
    options.trust = &trust_;
    options.now = [today] { return day(today); };
    options.stamp = authority.at(today);
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

  static constexpr const char* kShortPolicy =
      "new_hash = \"sha512\"\n[[algorithm]]\nname = \"sha256\"\nuntil = 2033-12-31\n[[algorithm]]\nname = "
      "\"sha512\"\n[[algorithm]]\nname = \"ecdsa\"\n[[algorithm]]\nname = \"ed25519\"\n";

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
  for (const EvidenceRenewal& result : renew(options)) {
    EXPECT_EQ(result.what, What::kWaits);
    EXPECT_EQ(result.text, "it had no record; no time-stamp came: nobody answers");
  }
  EXPECT_FALSE(fs::exists(record_of(cases_[0])));
  EXPECT_FALSE(fs::exists(record_of(cases_[1])));
}

TEST_F(EvidenceRenewalTest, ADryRunSaysWhatIsDueAndAsksNobody) {
  EvidenceRenewalOptions options = at("2027-01-01", first_);
  options.stamp = [](crypto::HashAlgorithm, ByteView) -> Bytes { throw Error("asked"); };
  options.dry_run = true;
  EXPECT_EQ(renew(options)[0].what, What::kBegun);
  EXPECT_FALSE(fs::exists(record_of(cases_[0]).parent_path()));
  renew(at("2027-01-01", first_));
  const std::string begun = test::contents(record_of(cases_[0]));
  options.now = [] { return day("2033-10-01"); };
  const auto due = renew(options);
  EXPECT_EQ(due[0].what, What::kTimeStampRenewed);
  EXPECT_THAT(due[0].text, HasSubstr("a certificate of CN=First"));
  EXPECT_EQ(due[0].before, day("2034-01-01"));
  options.now = [] { return day("2039-10-01"); };
  EXPECT_EQ(renew(options)[0].what, What::kRefused);
  EXPECT_EQ(test::contents(record_of(cases_[0])), begun);
}

TEST_F(EvidenceRenewalTest, ARecordThatDoesNotHoldIsLeftAsItIs) {
  renew(at("2027-01-01", first_));
  fs::copy_file(record_of(cases_[1]), record_of(cases_[0]), fs::copy_options::overwrite_existing);
  const auto early = renew(at("2028-01-01", second_));
  EXPECT_EQ(early[0].what, What::kRefused) << "also where nothing is due";
  EXPECT_THAT(early[0].text, HasSubstr("of this case: it is another's"));
  EXPECT_EQ(early[1].what, What::kNothingDue) << early[1].text;
  const auto results = renew(at("2033-10-01", second_));
  EXPECT_EQ(results[0].what, What::kRefused);
  EXPECT_THAT(results[0].text, HasSubstr("it does not cover the ledger of this case"));
  EXPECT_EQ(results[1].what, What::kTimeStampRenewed) << results[1].text;
  EXPECT_EQ(renew(at("2034-06-01", second_))[1].what, What::kNothingDue);
}

TEST_F(EvidenceRenewalTest, ARecordWhoseRootIsMissingIsNotCalledFalse) {
  // Another party renewed it, or somebody lost trust.pem: told as false, it would be moved away for a new
  // one.
  renew(at("2027-01-01", first_));
  const std::string kept = test::contents(record_of(cases_[0]));
  timestamp::TrustStore less;
  less.add_own_authority(bytes_of(archive_.authority().root_pem()), "own");
  less.add_trusted(bytes_of(second_.root_pem()), "second");
  EvidenceRenewalOptions options = at("2033-10-01", second_);
  options.trust = &less;
  for (const EvidenceRenewal& each : renew(options)) {
    EXPECT_EQ(each.what, What::kRefused);
    EXPECT_THAT(each.text,
                HasSubstr("holds could not be checked: the token of archiveTimeStampSequence[0][0]"));
    EXPECT_THAT(each.text, HasSubstr("leave it where it is"));
    EXPECT_THAT(each.text, Not(HasSubstr("does not hold")));
    EXPECT_THAT(each.text, Not(HasSubstr("move it away")));
  }
  EXPECT_EQ(test::contents(record_of(cases_[0])), kept);
  EXPECT_EQ(renew(at("2033-10-01", second_))[0].what, What::kTimeStampRenewed) << "with its root";
}

TEST_F(EvidenceRenewalTest, AWrongPolicyHasNoRecordThrownAway) {
  // A year mistyped, or an algorithm left out, and every record of the archive is told to be false.
  renew(at("2027-01-01", first_));
  for (const char* policy : {"[[algorithm]]\nname = \"sha256\"\nuntil = 2020-12-31\n[[algorithm]]\nname = "
                             "\"ecdsa\"\n[[algorithm]]\nname = \"ed25519\"\n",
                             "[[algorithm]]\nname = \"sha256\"\n"}) {
    const EvidenceRenewal result = renew(at("2028-01-01", second_, policy))[0];
    EXPECT_EQ(result.what, What::kRefused);
    EXPECT_THAT(result.text, HasSubstr("see whether the policy and the roots are the right ones"));
    EXPECT_THAT(result.text, HasSubstr("keep this one elsewhere"));
    EXPECT_THAT(result.text, Not(HasSubstr("move it away")));
  }
}

TEST_F(EvidenceRenewalTest, ARecordThatLapsedIsNotRenewed) {
  renew(at("2027-01-01", first_));
  const auto results = renew(at("2034-06-01", second_));
  EXPECT_EQ(results[0].what, What::kRefused);
  EXPECT_THAT(results[0].text, HasSubstr("nothing renewed it before"));
}

TEST_F(EvidenceRenewalTest, ACaseThatIsNotAtItsEndIsLeftAlone) {
  test::SampleCase open(archive_);
  open.record();
  cases_ = {open.folder(), cases_[0]};
  auto results = renew(at("2027-01-01", first_));
  EXPECT_EQ(results[0].what, What::kStillOpen);
  EXPECT_FALSE(fs::exists(record_of(cases_[0])));
  EXPECT_EQ(results[1].what, What::kBegun) << results[1].text;
  // Closed, and nobody signed that yet.
  open.writer().close("operator", archive_.now());
  results = renew(at("2027-01-01", first_));
  EXPECT_EQ(results[0].what, What::kStillOpen) << results[0].text;
  EXPECT_FALSE(fs::exists(record_of(cases_[0])));
}

TEST_F(EvidenceRenewalTest, OneTokenServesAllCasesAndWhatIsHeldIsBounded) {
  int asked = 0;
  const auto counted = [&](EvidenceRenewalOptions options) {
    options.stamp = [&asked, inner = options.stamp](crypto::HashAlgorithm algorithm, ByteView imprint) {
      ++asked;
      return inner(algorithm, imprint);
    };
    return options;
  };
  EvidenceRenewalOptions bounded = counted(at("2027-01-01", first_));
  bounded.most_bytes = 1;
  renew(bounded);
  EXPECT_EQ(asked, 2) << "each case that is held fills the bound";
  EXPECT_EQ(renew(counted(at("2033-10-01", second_)))[1].what, What::kTimeStampRenewed);
  EXPECT_EQ(asked, 3) << "one for both";
  for (const fs::path& folder : cases_) EXPECT_TRUE(verify(folder, "2035-01-01").evidence->holds);
}

TEST_F(EvidenceRenewalTest, ATimeStampRenewalReadsNoRecordingAndAHashTreeRenewalReadsAll) {
  const std::string policy = kPolicy;
  renew(at("2027-01-01", first_));
  for (const int index : {0, 1}) {
    const fs::path segment = cases_[0] / ("segments/endoscope/0000000" + std::to_string(index) + ".ts.age");
    fs::resize_file(segment, fs::file_size(segment) - 1);
  }
  EXPECT_EQ(renew(at("2033-10-01", second_, policy))[0].what, What::kTimeStampRenewed);
  const std::string before = test::contents(record_of(cases_[0]));
  const auto hashed = renew(at("2039-10-01", second_, policy));
  EXPECT_EQ(hashed[0].what, What::kRefused);
  EXPECT_EQ(hashed[0].unread, (std::vector<std::string>{"segments/endoscope/00000000.ts.age",
                                                        "segments/endoscope/00000001.ts.age"}));
  EXPECT_EQ(test::contents(record_of(cases_[0])), before);
  EXPECT_EQ(hashed[1].what, What::kHashTreeRenewed) << hashed[1].text;
}

TEST_F(EvidenceRenewalTest, ATimeStampThatLastsNoLongerIsNotTaken) {
  renew(at("2027-01-01", first_));
  const std::string before = test::contents(record_of(cases_[0]));
  const auto results = renew(at("2033-10-01", first_));
  EXPECT_EQ(results[0].what, What::kWaits);
  EXPECT_THAT(results[0].text, HasSubstr("lasts no longer than the record"));
  EXPECT_EQ(test::contents(record_of(cases_[0])), before);
}

TEST_F(EvidenceRenewalTest, TheRecordersOwnAuthorityRenewsNoRecordOfOutsideOnes) {
  const PlayedAuthority own("Own", "2026-01-01", "2060-01-01");
  trust_.add_own_authority(bytes_of(own.root_pem()), "own");
  renew(at("2027-01-01", first_));
  const std::string before = test::contents(record_of(cases_[0]));
  const auto results = renew(at("2033-10-01", own));
  EXPECT_EQ(results[0].what, What::kWaits);
  EXPECT_THAT(results[0].text, HasSubstr("would make the record self-issued"));
  EXPECT_EQ(test::contents(record_of(cases_[0])), before);
  // A record that is self-issued already goes on so.
  fs::remove(record_of(cases_[0]));
  EXPECT_EQ(renew(at("2033-10-01", own))[0].what, What::kBegun);
  EXPECT_FALSE(verify(cases_[0], "2035-01-01").evidence->outside);
}

TEST_F(EvidenceRenewalTest, ATokenThatWouldNotHoldIsNotTaken) {
  renew(at("2027-01-01", first_));
  const std::string before = test::contents(record_of(cases_[0]));
  EvidenceRenewalOptions options = at("2033-10-01", second_);
  const auto refusal = [&](const evidence::Stamp& stamp) {
    options.stamp = stamp;
    const EvidenceRenewal result = renew(options)[0];
    EXPECT_EQ(result.what, What::kWaits);
    EXPECT_EQ(test::contents(record_of(cases_[0])), before);
    return result.text;
  };
  EXPECT_THAT(refusal(first_.at("2026-10-01")), HasSubstr("before the one that it renews"));
  EXPECT_THAT(refusal(second_.at("2034-10-01")), HasSubstr("set the clock"));
  const PlayedAuthority stranger("Stranger", "2026-01-01", "2060-01-01");
  EXPECT_THAT(refusal(stranger.at("2033-10-01")), HasSubstr("does not count"));
  EXPECT_THAT(refusal([&](crypto::HashAlgorithm algorithm, ByteView) {
                return second_.at("2033-10-01")(algorithm, Bytes(32));
              }),
              HasSubstr("over another root"));
}

TEST_F(EvidenceRenewalTest, ANewHashThatEndedIsRefused) {
  const std::string weak =
      "[[algorithm]]\nname=\"sha256\"\nuntil=2026-12-31\n[[algorithm]]\nname=\"ecdsa\"\n";
  EXPECT_THAT(renew(at("2027-06-01", first_, weak))[0].text, HasSubstr("does not count any more"));
  EXPECT_FALSE(fs::exists(record_of(cases_[0])));
  const std::string ends =
      "[[algorithm]]\nname=\"sha256\"\nuntil=2027-12-31\n[[algorithm]]\nname=\"ecdsa\"\n";
  renew(at("2027-01-01", first_, ends));
  const auto results = renew(at("2027-10-01", first_, ends));
  EXPECT_EQ(results[0].what, What::kRefused);
  EXPECT_THAT(results[0].text, HasSubstr("no later than the one that it would replace"));
}

TEST_F(EvidenceRenewalTest, ARecordThatIsChangedMeanwhileIsNotWrittenOver) {
  renew(at("2027-01-01", first_));
  EvidenceRenewalOptions options = at("2033-10-01", second_);
  options.stamp = [&, inner = options.stamp](crypto::HashAlgorithm algorithm, ByteView imprint) {
    fs::remove(record_of(cases_[0]));
    return inner(algorithm, imprint);
  };
  const auto results = renew(options);
  EXPECT_EQ(results[0].what, What::kRefused);
  EXPECT_THAT(results[0].text, HasSubstr("was changed while its renewal was asked for"));
  EXPECT_FALSE(fs::exists(record_of(cases_[0])));
  EXPECT_EQ(results[1].what, What::kTimeStampRenewed) << results[1].text;
}

// Killed at each call that writes: the old record is there, or the new one, and either holds.
TEST_F(EvidenceRenewalTest, AKillAtAnyCallTearsNothing) {
  const auto renew_killed = [&](const EvidenceRenewalOptions& options, std::size_t at) {
    test::FaultFileSystem files(archive_.folder());
    files.kill_at(at);
    try {
      renew_evidence(files, cases_, options);
      files.lose_power();
      return false;
    } catch (const test::Killed&) {
      files.lose_power();
      return true;
    }
  };
  std::size_t kills = 0;
  for (; renew_killed(at("2027-01-01", first_), kills); ++kills) {
    for (const fs::path& folder : cases_) {
      const VerificationReport report = verify(folder, "2028-01-01");
      EXPECT_EQ(report.evidence.has_value(), fs::exists(record_of(folder)));
      EXPECT_TRUE(!report.evidence || report.evidence->holds) << kills;
    }
    fs::remove_all(archive_.folder() / "evidence");
  }
  EXPECT_GE(kills, 10U);
  const std::string begun = test::contents(record_of(cases_[0]));
  for (kills = 0; renew_killed(at("2033-10-01", second_), kills); ++kills) {
    for (const fs::path& folder : cases_) {
      EXPECT_TRUE(verify(folder, "2033-11-01").evidence->holds) << kills;
    }
  }
  EXPECT_GE(kills, 5U);
  EXPECT_NE(test::contents(record_of(cases_[0])), begun);
}

TEST_F(EvidenceRenewalTest, ADiskThatCannotBeWrittenLeavesTheRecordAsItWas) {
  renew(at("2027-01-01", first_));
  const std::string before = test::contents(record_of(cases_[0]));
  test::FaultFileSystem files(archive_.folder());
  files.fail("write evidence", ENOSPC, 0, 1);
  const auto results = renew_evidence(files, cases_, at("2033-10-01", second_));
  EXPECT_EQ(results[0].what, What::kRefused);
  EXPECT_THAT(results[0].text, HasSubstr("No space left"));
  EXPECT_EQ(test::contents(record_of(cases_[0])), before);
  EXPECT_EQ(results[1].what, What::kTimeStampRenewed) << results[1].text;
}

/// Counts how often each segment is opened.
class CountingFiles final : public FileReading {
 public:
  int open_at(int folder, const std::string& name, int flags, const fs::path& path) const override {
    const std::lock_guard guard(mutex_);
    if (name.ends_with(".age") && path.string().find("/segments/") != std::string::npos)
      ++opened_[path.string()];
    return FileReading::open_at(folder, name, flags, path);
  }
  [[nodiscard]] std::map<std::string, int> opened() const {
    const std::lock_guard guard(mutex_);
    return opened_;
  }

 private:
  mutable std::mutex mutex_;
  mutable std::map<std::string, int> opened_;
};

/// A case whose records are kept in versions, as a store keeps them.
class CaseInVersions final : public RenewableCase {
 public:
  CaseInVersions(fs::path folder, std::vector<Bytes>& versions)
      : folder_(std::move(folder)), versions_(versions) {}
  [[nodiscard]] std::string name() const override { return "case"; }
  fs::path folder() override { return folder_; }
  const FileReading& files() override { return files_; }
  [[nodiscard]] std::string record_place(const std::string& case_id) const override { return case_id; }
  std::vector<Bytes> read_records(const std::string& /*case_id*/) override { return versions_; }
  void write_record(const std::string& /*case_id*/, ByteView record) override {
    versions_.push_back(to_bytes(record));
  }
  [[nodiscard]] bool keeps_all_records() const override { return true; }
  void let_go() override {
    if (is_away) throw RenewalWaits("the store does not answer");
  }
  [[nodiscard]] const CountingFiles& counted() const { return files_; }

  bool is_away = false;

 private:
  const fs::path folder_;
  std::vector<Bytes>& versions_;
  CountingFiles files_;
};

TEST_F(EvidenceRenewalTest, OfSeveralRecordsTheOneThatHoldsIsRenewedAndAllStay) {
  renew(at("2027-01-01", first_));
  const Bytes right = to_bytes(test::contents(record_of(cases_[0])));
  const Bytes others = to_bytes(test::contents(record_of(cases_[1])));
  std::vector<Bytes> versions{to_bytes("nonsense"), others, right};
  std::vector<std::unique_ptr<RenewableCase>> cases;
  cases.push_back(std::make_unique<CaseInVersions>(cases_[0], versions));
  const EvidenceRenewal done = renew_evidence(cases, at("2033-10-01", second_)).front();
  EXPECT_EQ(done.what, What::kTimeStampRenewed) << done.text;
  ASSERT_EQ(versions.size(), 4U);
  EXPECT_EQ(done.holds, crypto::sha256(versions.back()));
  std::ofstream(record_of(cases_[0]), std::ios::binary) << text_of(versions.back());
  EXPECT_TRUE(verify(cases_[0], "2035-01-01").evidence->holds);
  const EvidenceRenewal again = renew_evidence(cases, at("2034-06-01", second_)).front();
  EXPECT_EQ(again.what, What::kNothingDue) << again.text;
  EXPECT_EQ(again.holds, crypto::sha256(versions.back()));
}

TEST_F(EvidenceRenewalTest, BesideARecordThatLapsedOneIsBegunWhereBothStay) {
  renew(at("2027-01-01", first_));
  const Bytes lapsed = to_bytes(test::contents(record_of(cases_[0])));
  std::vector<Bytes> versions{lapsed};
  std::vector<std::unique_ptr<RenewableCase>> cases;
  cases.push_back(std::make_unique<CaseInVersions>(cases_[0], versions));
  EvidenceRenewalOptions options = at("2035-01-01", second_);
  const EvidenceRenewal refused = renew_evidence(cases, options).front();
  EXPECT_EQ(refused.what, What::kRefused);
  EXPECT_THAT(refused.text, HasSubstr("begun beside it, renew with --begin-anew"));
  EXPECT_EQ(versions.size(), 1U);
  options.begin_anew = true;
  const EvidenceRenewal begun = renew_evidence(cases, options).front();
  EXPECT_EQ(begun.what, What::kBegun) << begun.text;
  EXPECT_THAT(begun.text, HasSubstr("does not hold"));
  ASSERT_EQ(versions.size(), 2U);
  EXPECT_EQ(versions[0], lapsed);
  EXPECT_EQ(renew_evidence(cases, options).front().what, What::kNothingDue);
  // On a disk the new one would take the old one's place.
  EXPECT_EQ(renew(options)[0].what, What::kRefused);
  EXPECT_EQ(to_bytes(test::contents(record_of(cases_[0]))), lapsed);
}

TEST_F(EvidenceRenewalTest, WhatCouldNotBeReadForNowSaysNothingOfTheCase) {
  std::vector<Bytes> versions, of_other;
  std::vector<std::unique_ptr<RenewableCase>> cases;
  auto away = std::make_unique<CaseInVersions>(cases_[0], versions);
  away->is_away = true;
  cases.push_back(std::move(away));
  cases.push_back(std::make_unique<CaseInVersions>(cases_[1], of_other));
  const auto results = renew_evidence(cases, at("2027-01-01", first_));
  EXPECT_EQ(results[0].what, What::kWaits);
  EXPECT_EQ(results[0].text, "the store does not answer");
  EXPECT_TRUE(versions.empty());
  EXPECT_EQ(results[1].what, What::kBegun) << results[1].text;
  EXPECT_EQ(of_other.size(), 1U);
}

TEST_F(EvidenceRenewalTest, ANewHashReadsEachSegmentOnce) {
  std::vector<Bytes> versions;
  std::vector<std::unique_ptr<RenewableCase>> cases;
  auto owned = std::make_unique<CaseInVersions>(cases_[0], versions);
  const CaseInVersions* const of = owned.get();
  cases.push_back(std::move(owned));
  renew_evidence(cases, at("2027-01-01", first_));
  ASSERT_EQ(versions.size(), 1U);
  const std::map<std::string, int> begun = of->counted().opened();
  EXPECT_GE(begun.size(), 2U);
  const EvidenceRenewal done = renew_evidence(cases, at("2033-10-01", second_, kShortPolicy)).front();
  EXPECT_EQ(done.what, What::kHashTreeRenewed) << done.text;
  for (const auto& [segment, times] : of->counted().opened())
    EXPECT_EQ(times - begun.at(segment), 1) << segment;
}

TEST_F(EvidenceRenewalTest, OneProcessAtATimeRenews) {
  const auto first =
      std::make_unique<EvidenceLock>(EvidenceLock::take(real_file_system(), archive_.folder()));
  EXPECT_THROW(EvidenceLock::take(real_file_system(), archive_.folder()), UsageError);
}

}  // namespace
}  // namespace kiroku::archive

#include "recorder/late_stamping.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/verify/verifier.h"
#include "archive/writing/log_reading.h"
#include "base/error.h"
#include "tests/support/case_kit.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/switched_authority.h"
#include "tests/support/temporary_folder.h"
#include "timestamp/authority.h"

namespace kiroku::recorder {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using archive::CaseWriter;
using archive::Verdict;
using test::moment;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

constexpr auto kLimitsOnly = LateStamping::Patience::kLimitsOnly;
constexpr auto kAllPauses = LateStamping::Patience::kAllPauses;

/// An archive whose authorities can be cut off. Authorities "swiss" and "free" are one behind two switches.
class LateStampingTest : public testing::Test {
 protected:
  LateStampingTest() {
    fs::create_directory(kit_.archive());
    trust_.add_trusted(bytes_of(authority_.root_pem()), "the embedded authority");
    log_ = archive::ApplianceLog::open(archive::real_file_system(), kit_.archive() / "log", kit_.key(),
                                       "theatre-1");
  }

  /// A case that was closed without a token, as recording leaves it; wanted from `authorities`.
  fs::path closed_case(const std::vector<std::string>& authorities = {"swiss"}) {
    CaseWriter::Options options = kit_.options();
    options.log = log_.get();
    // Nothing is recorded of the one stream, and it says so.
    options.streams = {options.streams.back()};
    options.stream_recipients.resize(1);
    const auto writer = CaseWriter::create(archive::real_file_system(), options, moment(0));
    for (const std::string& name : authorities) {
      queue_->want(writer->case_id(), name, 1,
                   *parse_utc("2026-08-05T09:15:02Z") + std::chrono::seconds(wanted_++));
    }
    writer->append({archive::GapEntry{options.streams.front().name, {0, 5'000'000'000}}},
                   moment(5'000'000'000));
    writer->close("operator", moment(5'000'000'000));
    const archive::StoredCheckpoint closing = writer->checkpoint(moment(5'000'000'000), true);
    for (const std::string& name : authorities) {
      writer->append({archive::TokenMissedEntry{closing.size, name, "the network is down"}},
                     moment(6'000'000'000));
    }
    writer->finish(moment(6'000'000'000));
    return writer->folder();
  }

  [[nodiscard]] LateStamping::Context around(archive::FileSystem* files = nullptr) {
    return {files, kit_.archive(), &kit_.key(), "theatre-1", log_.get(), &trust_, queue_.get()};
  }
  [[nodiscard]] LateStamping late(BackOffPolicy pauses = {}, archive::FileSystem* files = nullptr) {
    return LateStamping({{"swiss", swiss_, pauses}, {"free", free_, pauses}}, around(files));
  }
  archive::VerificationReport verify(const fs::path& folder) {
    archive::VerifyOptions options;
    options.devices = {crypto::VerifierKey("theatre-1", kit_.key().public_key())};
    options.trust = &trust_;
    options.log = kit_.archive() / "log";
    return archive::verify_case(folder, options);
  }
  static std::vector<std::string> codes(const archive::VerificationReport& report) {
    std::vector<std::string> codes;
    for (const archive::Finding& finding : report.findings) codes.push_back(finding.code);
    return codes;
  }

  test::TemporaryFolder folder_{test::quick_parent()};
  test::CaseKit kit_{folder_ / "archive"};
  timestamp::Authority authority_ = timestamp::Authority::create(folder_ / "authority", "Test");
  timestamp::TrustStore trust_;
  std::shared_ptr<test::SwitchedAuthority> swiss_ =
      std::make_shared<test::SwitchedAuthority>(timestamp::embedded_stamp_source(authority_));
  std::shared_ptr<test::SwitchedAuthority> free_ =
      std::make_shared<test::SwitchedAuthority>(timestamp::embedded_stamp_source(authority_));
  std::unique_ptr<StampingQueue> queue_ = StampingQueue::open(folder_ / "stamping.sqlite");
  std::unique_ptr<archive::ApplianceLog> log_;
  int wanted_ = 0;
};

TEST_F(LateStampingTest, ACaseThatEndedInAnOutageGetsItsTokenLater) {
  const fs::path folder = closed_case();
  EXPECT_EQ(verify(folder).verdict, Verdict::kUnproven);
  const LateStamping::Result result = late().work_off(kLimitsOnly);
  ASSERT_THAT(result.stamped, SizeIs(1));
  EXPECT_EQ(result.stamped[0].case_id, folder.filename().string());
  EXPECT_EQ(result.stamped[0].authority, "swiss");
  EXPECT_EQ(result.stamped[0].path, "over wwan0");
  EXPECT_THAT(result.waiting, IsEmpty());
  EXPECT_THAT(queue_->list(), IsEmpty());
  const auto report = verify(folder);
  EXPECT_EQ(report.verdict, Verdict::kIntactWithGaps) << testing::PrintToString(codes(report));
  EXPECT_THAT(codes(report), ElementsAre("gap", "token-missed"));
  EXPECT_TRUE(report.brackets.front().not_after) << "everything before the token is covered by it";
  const auto log = archive::read_log(kit_.archive() / "log");
  EXPECT_EQ(log.back().type, "case-checkpoint") << "the log knows of the token's entry";
  archive::VerifyOptions of_log;
  of_log.devices = {crypto::VerifierKey("theatre-1", kit_.key().public_key())};
  EXPECT_EQ(archive::verify_log(kit_.archive() / "log", of_log).verdict, Verdict::kIntact);
}

TEST_F(LateStampingTest, EveryAuthorityThatAnswersIsEnteredInOneGo) {
  const fs::path folder = closed_case({"swiss", "free"});
  swiss_->up = false;
  LateStamping::Result result = late().work_off(kLimitsOnly);
  EXPECT_THAT(result.stamped, SizeIs(1));
  ASSERT_THAT(result.waiting, SizeIs(1));
  EXPECT_EQ(result.waiting[0].reason, "the authority is not there");
  EXPECT_EQ(verify(folder).verdict, Verdict::kIntactWithGaps);
  ASSERT_THAT(queue_->list(), SizeIs(1));
  EXPECT_EQ(queue_->list()[0].authority, "swiss");
  EXPECT_EQ(queue_->list()[0].attempts, 1U);
  swiss_->up = true;
  result = late().work_off(kLimitsOnly);
  EXPECT_THAT(result.stamped, SizeIs(1));
  EXPECT_EQ(verify(folder).verdict, Verdict::kIntactWithGaps);
  EXPECT_EQ(verify(folder).tokens, 2U);
}

TEST_F(LateStampingTest, PausesHoldAcrossANewStartForProgramsAndNotForPeople) {
  const fs::path folder = closed_case();
  swiss_->up = false;
  EXPECT_THAT(late().work_off(kAllPauses).waiting, SizeIs(1));
  EXPECT_EQ(swiss_->requests, 1);
  swiss_->up = true;
  LateStamping again = late();
  const LateStamping::Result waiting = again.work_off(kAllPauses);
  ASSERT_THAT(waiting.waiting, SizeIs(1));
  EXPECT_THAT(waiting.waiting[0].reason, HasSubstr("swiss is left alone for another"));
  EXPECT_THAT(waiting.waiting[0].reason, HasSubstr("the authority is not there"));
  EXPECT_EQ(swiss_->requests, 1);
  ASSERT_TRUE(again.next());
  EXPECT_GT(*again.next(), std::chrono::steady_clock::now() + 15s);
  EXPECT_THAT(late().work_off(kLimitsOnly).stamped, SizeIs(1));
  EXPECT_EQ(verify(folder).verdict, Verdict::kIntactWithGaps);
}

TEST_F(LateStampingTest, WhatAnAuthorityDemandsHoldsForPeopleToo) {
  (void)closed_case();
  swiss_->up = false;
  swiss_->leave_alone_for_s = 1200;
  EXPECT_THAT(late().work_off(kLimitsOnly).waiting, SizeIs(1));
  swiss_->up = true;
  EXPECT_THAT(late().work_off(kLimitsOnly).stamped, IsEmpty());
  EXPECT_EQ(swiss_->requests, 1);
}

TEST_F(LateStampingTest, ALeastIntervalIsKeptBetweenCasesOldestFirst) {
  const fs::path first = closed_case();
  const fs::path second = closed_case();
  const BackOffPolicy pauses{.min_interval = 1h};
  const LateStamping::Result result = late(pauses).work_off(kLimitsOnly);
  ASSERT_THAT(result.stamped, SizeIs(1));
  EXPECT_EQ(result.stamped[0].case_id, first.filename().string());
  ASSERT_THAT(result.waiting, SizeIs(1));
  EXPECT_EQ(result.waiting[0].wanted.case_id, second.filename().string());
  EXPECT_THAT(late(pauses).work_off(kLimitsOnly).stamped, IsEmpty());
  EXPECT_EQ(swiss_->requests, 1);
}

TEST_F(LateStampingTest, LeavesACaseAloneThatAnotherProcessWrites) {
  CaseWriter::Options options = kit_.options();
  options.log = log_.get();
  const auto writer = CaseWriter::create(archive::real_file_system(), options, moment(0));
  queue_->want(writer->case_id(), "swiss", 1, utc_now());
  const LateStamping::Result result = late().work_off(kLimitsOnly);
  ASSERT_THAT(result.waiting, SizeIs(1));
  EXPECT_THAT(result.waiting[0].reason, HasSubstr("another process is writing"));
  EXPECT_EQ(swiss_->requests, 0);
  EXPECT_THAT(queue_->list(), SizeIs(1));
}

TEST_F(LateStampingTest, LeavesAnUnclosedCaseToRecovery) {
  CaseWriter::Options options = kit_.options();
  options.log = log_.get();
  auto writer = CaseWriter::create(archive::real_file_system(), options, moment(0));
  const fs::path folder = writer->folder();
  queue_->want(writer->case_id(), "swiss", 1, utc_now());
  writer.reset();
  const std::string before = test::contents(folder / "ledger.jsonl");
  const LateStamping::Result result = late().work_off(kLimitsOnly);
  ASSERT_THAT(result.waiting, SizeIs(1));
  EXPECT_THAT(result.waiting[0].reason, HasSubstr("was not closed"));
  EXPECT_EQ(test::contents(folder / "ledger.jsonl"), before);
}

TEST_F(LateStampingTest, DropsWhatNobodyCanGiveAnyMore) {
  const fs::path folder = closed_case({"gone"});
  queue_->want("20260101T000000Z-00000000", "swiss", 1, utc_now());
  queue_->want("../elsewhere", "swiss", 1, utc_now());
  const LateStamping::Result result = late().work_off(kLimitsOnly);
  std::vector<std::string> reasons;
  for (const auto& each : result.dropped) reasons.push_back(each.case_id + ": " + each.reason);
  EXPECT_THAT(reasons, testing::UnorderedElementsAre(
                           folder.filename().string() + ": no authority of that name is configured any more",
                           "20260101T000000Z-00000000: the case is not in the archive any more",
                           "../elsewhere: the case is not in the archive any more"));
  EXPECT_THAT(queue_->list(), IsEmpty());
}

TEST_F(LateStampingTest, DoesNotAskTwiceForWhatIsThere) {
  const fs::path folder = closed_case();
  LateStamping stamping = late();
  stamping.work_off(kLimitsOnly);
  stamping.want(folder.filename().string());
  const LateStamping::Result result = stamping.work_off(kLimitsOnly);
  ASSERT_THAT(result.stamped, SizeIs(1));
  EXPECT_EQ(result.stamped[0].authority, "free");
  EXPECT_EQ(swiss_->requests, 1);
  EXPECT_THAT(queue_->list(), IsEmpty());
}

// A kill at every call of the file system, then a new start: nothing is lost, and nothing ever looks like
// tampering.
TEST_F(LateStampingTest, IsTakenUpAgainWhereverItIsCutOff) {
  std::size_t kills = 0;
  for (std::size_t at = 0;; ++at) {
    const fs::path folder = closed_case();
    test::FaultFileSystem files(kit_.archive());
    files.kill_at(at);
    bool killed = false;
    try {
      late({}, &files).work_off(kLimitsOnly);
    } catch (const test::Killed&) {
      killed = true;
    }
    if (!killed) break;
    ++kills;
    const auto cut_off = verify(folder);
    EXPECT_EQ(std::ranges::count(cut_off.findings, "gap", &archive::Finding::code), 1) << "the case's own";
    for (const archive::Finding& finding : cut_off.findings) {
      EXPECT_THAT(finding.code,
                  testing::AnyOf("gap", "token-missed", "no-token", "token-not-entered", "part-file",
                                 "token-not-covered", "ledger-torn", "end-not-stamped"))
          << "killed at call " << at << ": " << finding.text;
    }
    const LateStamping::Result result = late().work_off(kLimitsOnly);
    EXPECT_THAT(result.waiting, IsEmpty()) << result.waiting.front().reason;
    const auto report = verify(folder);
    EXPECT_EQ(report.verdict, Verdict::kIntactWithGaps)
        << "killed at call " << at << ": " << testing::PrintToString(codes(report));
    EXPECT_THAT(codes(report), Contains("token-missed"));
    EXPECT_EQ(report.tokens, 1U);
    EXPECT_THAT(queue_->list(), IsEmpty());
  }
  EXPECT_GE(kills, 15U);
}

}  // namespace
}  // namespace kiroku::recorder

#include "viewer/kept/log_of_case.h"

#include <gmock/gmock.h>

#include "base/bytes.h"
#include "tests/support/nanoseconds.h"

namespace kiroku::compare {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using Answer = Check::Answer;

/// A log of four entries under which a case was opened, ten seconds after its room began to record ahead.
class SealedBefore : public testing::Test {
 protected:
  SealedBefore() {
    open_.device = "or3";
    open_.appliance_log_size = 4;
    open_.begins_ns = 20 * kSecond;
    log_.case_began_under_it = true;
    log_.opening = {first_line_, true};
  }
  [[nodiscard]] std::vector<Check> check(std::uint64_t seq, UtcTime sealed) {
    log_.sealed_plans[seal_] = {seq, sealed, {}, true};
    return check_sealed_before(log_, "or3", {open_, {opened_, 30 * kSecond}, first_line_}, seal_);
  }

  const UtcTime opened_{std::chrono::sys_days{std::chrono::year{2026} / 11 / 24} + 1h};
  const crypto::Sha256Digest seal_ = crypto::sha256(bytes_of("seal"));
  const crypto::Sha256Digest first_line_ = crypto::sha256(bytes_of("first line"));
  archive::OpenEntry open_;
  LogOfCase log_;
};

TEST_F(SealedBefore, OfACaseThatWasRecordedAheadIsNotBeforeItsOpeningAlone) {
  const std::vector<Check> within = check(3, opened_ - 2s);
  ASSERT_EQ(within.size(), 2U);
  EXPECT_EQ(within[0].answer, Answer::kHolds);
  EXPECT_THAT(within[0].text, HasSubstr("sealed before the case was opened: "));
  EXPECT_EQ(within[1].what, "ahead");
  EXPECT_EQ(within[1].answer, Answer::kDiffers);
  EXPECT_THAT(within[1].text, HasSubstr("10 s of the case were recorded before it was opened, from "
                                        "2026-11-24T00:59:50.000000Z on, and the plan was sealed only after "
                                        "that: 2026-11-24T00:59:58.000000Z"));
  EXPECT_EQ(check(3, opened_ - 10s)[1].answer, Answer::kDiffers);
}

TEST_F(SealedBefore, OfACaseThatWasRecordedAheadHoldsBeforeItsFirstPicture) {
  const std::vector<Check> before = check(3, opened_ - 11s);
  ASSERT_EQ(before.size(), 2U);
  EXPECT_EQ(verdict_of(before), Answer::kHolds);
  EXPECT_THAT(before[1].text, HasSubstr("sealed before that"));
  for (const Check& each : before) EXPECT_THAT(each.text, testing::Not(HasSubstr("first picture")));
}

TEST_F(SealedBefore, OfAnyOtherCaseNeedsNoClock) {
  open_.begins_ns = 0;
  const std::vector<Check> checks = check(3, opened_ + 1h);
  ASSERT_EQ(checks.size(), 1U);
  EXPECT_EQ(checks[0].answer, Answer::kHolds);
  EXPECT_THAT(checks[0].text, HasSubstr("sealed before the first picture"));
}

TEST_F(SealedBefore, IsNotWhatTheLogHasOnlyAfterTheCase) {
  const std::vector<Check> checks = check(4, opened_ - 1h);
  ASSERT_EQ(checks.size(), 1U);
  EXPECT_EQ(checks[0].answer, Answer::kDiffers);
}

// Whoever has the disk writes another plan's seal into the case's first entry.
TEST_F(SealedBefore, OfAFirstEntryThatTheLogDoesNotStateIsNotToldAsSealedBefore) {
  const auto answer = [&] {
    const std::vector<Check> checks = check(3, opened_ - 1h);
    return checks.size() == 1 && checks[0].what == "opening" ? checks[0].answer : Answer::kHolds;
  };
  log_.opening = {crypto::sha256(bytes_of("another line")), true};
  EXPECT_EQ(answer(), Answer::kDiffers);
  log_.opening->is_signed = false;
  EXPECT_EQ(answer(), Answer::kUnknown);
  log_.opening->sha256 = first_line_;
  EXPECT_EQ(answer(), Answer::kUnknown) << "nobody signed that the case was opened";
  log_.opening.reset();
  EXPECT_EQ(answer(), Answer::kUnknown);
}

}  // namespace
}  // namespace kiroku::compare

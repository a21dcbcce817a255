#include "archive/upkeep/age.h"

#include <chrono>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/log_entry.h"
#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

const UtcTime kNow = *parse_utc("2026-11-28T20:00:00Z");
constexpr std::chrono::hours kDay{24};

/// Entries of one case, second by second on its clock.
class AgeOfCases : public testing::Test {
 protected:
  void enter(UtcTime utc, std::chrono::nanoseconds mono, CaseEntryBody body) {
    opening_.take({seq_++, {utc, mono.count()}, std::move(body)});
  }
  static TokenEntry token(UtcTime gen_time) {
    TokenEntry entry;
    entry.gen_time = gen_time;
    return entry;
  }
  OpeningTime opening_;
  std::uint64_t seq_ = 0;
};

TEST_F(AgeOfCases, OfAClockThatWasRightIsWhatTheFirstEntrySays) {
  enter(kNow, 0s, OpenEntry{});
  enter(kNow + 10s, 10s, ClockEntry{});
  enter(kNow + 19s, 20s, token(kNow + 19s));
  enter(kNow + 4h, 4h, CloseEntry{});
  enter(kNow + 5h, 4h, TokenMissedEntry{});
  EXPECT_EQ(opening_.at(), kNow) << "however long it was recorded";
}

TEST_F(AgeOfCases, AClockThatIsSetRightWhileItIsRecordedSaysWhenItWasOpened) {
  enter(kNow - 400 * kDay, 1s, OpenEntry{});
  enter(kNow + 60s, 61s, ClockEntry{});
  enter(kNow + 4h, 4h, CloseEntry{});
  EXPECT_LT(std::chrono::abs(opening_.at() - kNow), 2s);
}

TEST_F(AgeOfCases, OneThatIsSetBackMakesNoCaseOlder) {
  enter(kNow, 0s, OpenEntry{});
  enter(kNow - 400 * kDay, 60s, ClockEntry{});
  enter(kNow - 400 * kDay + 1h, 1h, CloseEntry{});
  EXPECT_EQ(opening_.at(), kNow);
}

TEST_F(AgeOfCases, ATokenThatCameLateIsABoundAndLaterOnesAreNone) {
  enter(kNow - 400 * kDay, 0s, OpenEntry{});
  enter(kNow - 400 * kDay + 1h, 1h, CloseEntry{});
  EXPECT_EQ(opening_.at(), kNow - 400 * kDay);
  enter(kNow + kDay, 1h, token(kNow));
  EXPECT_EQ(opening_.at(), kNow - 1h);
  enter(kNow + 30 * kDay, 1h, token(kNow + 30 * kDay));
  EXPECT_EQ(opening_.at(), kNow - 1h) << "a second authority's, or an erasure's";
}

TEST_F(AgeOfCases, WhatIsErasedMakesTheRestNoYounger) {
  enter(kNow - 40 * kDay, 0s, OpenEntry{});
  enter(kNow - 40 * kDay + 1h, 1h, CloseEntry{});
  enter(kNow, 1h, ErasedEntry{});
  enter(kNow, 1h, token(kNow));
  EXPECT_EQ(opening_.at(), kNow - 40 * kDay);
}

class LogTime : public testing::Test {
 protected:
  void enter(UtcTime utc, LogEntryBody body) {
    std::ofstream(folder_ / "ledger.jsonl", std::ios::app)
        << to_line(LogEntry{seq_++, {utc, 0}, std::move(body)}) << "\n";
  }
  void open_case(UtcTime utc, const std::string& name) { enter(utc, CaseOpenedEntry{name, {}}); }
  [[nodiscard]] LogTimes read() const { return read_log_times(folder_.path(), kNow); }

  const std::string early_ = "20251024T200000Z-00000001", late_ = "20251024T210000Z-00000002";
  test::TemporaryFolder folder_;
  std::uint64_t seq_ = 0;
};

TEST_F(LogTime, ACaseIsNoOlderThanWhatWasEnteredBeforeIt) {
  EXPECT_TRUE(read().before_case.empty());
  EXPECT_FALSE(read().newest);
  open_case(kNow - 50 * kDay, early_);
  enter(kNow - 10 * kDay, ShutdownEntry{});
  // The battery was empty.
  open_case(kNow - 400 * kDay, late_);
  const LogTimes times = read();
  EXPECT_FALSE(times.before_case.contains(early_));
  EXPECT_EQ(times.before_case.at(late_), kNow - 10 * kDay);
  EXPECT_EQ(times.newest, kNow - 10 * kDay);
}

TEST_F(LogTime, EntriesOfAClockThatWasAheadKeepNoLaterCaseForYears) {
  enter(kNow + 4000 * kDay, ShutdownEntry{});
  open_case(kNow - 50 * kDay, early_);
  EXPECT_FALSE(read().before_case.contains(early_));
  open_case(kNow - 40 * kDay, late_);
  EXPECT_EQ(read().before_case.at(late_), kNow - 50 * kDay);
}

TEST_F(LogTime, ADamagedLineIsToldAndNotPassedOver) {
  std::ofstream(folder_ / "ledger.jsonl") << "{\n";
  EXPECT_THROW((void)read(), Error);
}

TEST_F(LogTime, AClockThatIsNotSetIsNotBelieved) {
  LogTimes log;
  EXPECT_EQ(why_clock_is_doubted(true, kNow, log), "") << "nothing was ever entered";
  EXPECT_THAT(why_clock_is_doubted(false, kNow, log), HasSubstr("synchronised"));
  log.newest = kNow - 120 * kDay;
  EXPECT_EQ(why_clock_is_doubted(true, kNow, log), "") << "a recorder that stood for the summer";
  EXPECT_THAT(why_clock_is_doubted(true, kNow + 4000 * kDay, log), HasSubstr("more than a year before"));
  log.newest = kNow + kDay;
  EXPECT_EQ(why_clock_is_doubted(true, kNow, log), "");
}

}  // namespace
}  // namespace kiroku::archive

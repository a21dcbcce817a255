#include "archive/verify/stated_slews.h"

#include <gtest/gtest.h>

#include "tests/support/nanoseconds.h"

namespace kiroku::archive {
namespace {

constexpr std::int64_t kPpm = 1'000;

TEST(StatedSlews, NothingStatedMovesNothing) {
  const StatedSlews slews;
  EXPECT_EQ(slews.until(0), 0);
  EXPECT_EQ(slews.until(3'600 * kSecond), 0);
}

TEST(StatedSlews, WhatACrystalNeedsIsNone) {
  StatedSlews slews;
  slews.add(200 * kPpm, 60 * kSecond);
  slews.add(-200 * kPpm, 120 * kSecond);
  EXPECT_EQ(slews.until(180 * kSecond), 0);
}

// As recorders state it that say no more of a slew than its beginning and its end.
TEST(StatedSlews, TheMeanAtItsEndCountsFromItsBeginningOn) {
  StatedSlews slews;
  slews.add(0, 0);
  slews.add(2'700 * kPpm, 10 * kSecond);
  slews.add(-80'000 * kPpm, 40 * kSecond);  // either way
  slews.add(0, 41 * kSecond);
  slews.add(0, 101 * kSecond);
  EXPECT_EQ(slews.until(10 * kSecond), 27 * kMs);
  EXPECT_EQ(slews.until(25 * kSecond), 27 * kMs + 1'200 * kMs);
  EXPECT_EQ(slews.until(40 * kSecond), 27 * kMs + 2'400 * kMs);
  EXPECT_EQ(slews.until(41 * kSecond), 27 * kMs + 2'480 * kMs);
  EXPECT_EQ(slews.until(100 * kSecond), 27 * kMs + 2'480 * kMs);
}

TEST(StatedSlews, BehindABeginningThatNothingFollowsTheKernelsLimitHolds) {
  StatedSlews slews;
  slews.add(0, 0);
  slews.add(2'700 * kPpm, 10 * kSecond);
  EXPECT_EQ(slews.until(20 * kSecond) - slews.until(10 * kSecond), 1'005 * kMs);
  slews.add(2'700 * kPpm, 20 * kSecond);
  EXPECT_EQ(slews.until(20 * kSecond) - slews.until(10 * kSecond), 27 * kMs);
  EXPECT_EQ(slews.until(30 * kSecond) - slews.until(20 * kSecond), 27 * kMs) << "it is known by now";
}

TEST(StatedSlews, NoStatementExcusesMoreThanAKernelDoes) {
  for (const std::int64_t rate_ppb : {INT64_MAX, INT64_MIN, std::int64_t{200'000'000}}) {
    StatedSlews slews;
    slews.add(rate_ppb, 10 * kSecond);
    EXPECT_EQ(slews.until(10 * kSecond), 1'005 * kMs);
    EXPECT_EQ(slews.until(20 * kSecond), 2'010 * kMs);
  }
}

TEST(StatedSlews, ARecordingThatWasCutOffEndsThem) {
  StatedSlews slews;
  slews.add(0, 0);
  slews.add(80'000 * kPpm, 10 * kSecond);
  slews.add(80'000 * kPpm, 20 * kSecond);
  slews.cut_off(30 * kSecond);
  EXPECT_EQ(slews.until(30 * kSecond), 2'400 * kMs);
  EXPECT_EQ(slews.until(86'400 * kSecond), 2'400 * kMs);
}

TEST(StatedSlews, TimesThatGoBackTakeNothingBack) {
  StatedSlews slews;
  slews.add(80'000 * kPpm, 100 * kSecond);
  slews.add(80'000 * kPpm, 50 * kSecond);
  slews.add(0, -kSecond);
  EXPECT_EQ(slews.until(-kSecond), 0);
  EXPECT_EQ(slews.until(50 * kSecond), 4'000 * kMs);
  EXPECT_EQ(slews.until(200 * kSecond), 8'000 * kMs);
}

}  // namespace
}  // namespace kiroku::archive

#include "recorder/back_off.h"

#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using std::chrono::nanoseconds;

constexpr BackOff::Time kStart{std::chrono::hours(1000)};

TEST(BackOff, AsksAtOnceAtFirstAndAfterASuccess) {
  BackOff back_off({}, 1);
  EXPECT_LE(back_off.next(), kStart);
  back_off.asked(kStart);
  back_off.failed(kStart, {});
  EXPECT_GT(back_off.next(), kStart);
  back_off.asked(kStart + 1min);
  back_off.succeeded();
  EXPECT_LE(back_off.next(), kStart + 1min);
  EXPECT_EQ(back_off.failures(), 0U);
}

TEST(BackOff, DoublesThePauseUpToTheLongestAQuarterMoreOrLess) {
  BackOff back_off({.first = 30s, .longest = 10min}, 1);
  nanoseconds usual = 30s;
  for (int i = 0; i < 12; ++i) {
    back_off.failed(kStart, {});
    const nanoseconds pause = back_off.next() - kStart;
    EXPECT_GE(pause, usual * 3 / 4) << i;
    EXPECT_LE(pause, usual * 5 / 4) << i;
    usual = std::min<nanoseconds>(usual * 2, 10min);
  }
}

TEST(BackOff, RecordersThatFailTogetherDoNotComeBackTogether) {
  std::vector<BackOff::Time> times;
  for (std::uint32_t seed = 1; seed <= 8; ++seed) {
    BackOff back_off({}, seed * 7919);
    back_off.failed(kStart, {});
    times.push_back(back_off.next());
  }
  std::sort(times.begin(), times.end());
  EXPECT_EQ(std::unique(times.begin(), times.end()), times.end());
}

TEST(BackOff, TwoHoursOfOutageCostAFewRequestsAndAreOverWithinTheLongestPause) {
  BackOff back_off({}, 3);
  auto now = kStart;
  int requests = 0;
  while (now < kStart + 2h) {
    back_off.asked(now);
    back_off.failed(now, {});
    ++requests;
    now = back_off.next();
  }
  EXPECT_GE(requests, 10);
  EXPECT_LE(requests, 22);
  EXPECT_LE(now, kStart + 2h + 10min * 5 / 4);
}

TEST(BackOff, LeavesAnAuthorityAloneForAsLongAsItAsks) {
  BackOff back_off({}, 1);
  back_off.asked(kStart);
  back_off.failed(kStart, nanoseconds(24h));
  EXPECT_EQ(back_off.limit(), kStart + 24h);
  EXPECT_EQ(back_off.next(), kStart + 24h);
}

TEST(BackOff, KeepsTheLeastIntervalWhateverCameOfTheRequest) {
  BackOff back_off({.min_interval = 75s}, 1);
  back_off.asked(kStart);
  back_off.succeeded();
  EXPECT_EQ(back_off.limit(), kStart + 75s);
  EXPECT_EQ(back_off.next(), kStart + 75s);
  back_off.asked(kStart + 80s);
  back_off.failed(kStart + 80s, {});
  EXPECT_EQ(back_off.limit(), kStart + 155s);
}

TEST(BackOff, NeverMoreThanTwentyRequestsInTwentyMinutesWithAnInterval) {
  BackOff back_off({.min_interval = 75s}, 1);
  std::vector<BackOff::Time> requests;
  for (auto now = kStart; now < kStart + 3h; now += 1min) {  // wanted each minute
    if (now < back_off.next()) continue;
    back_off.asked(now);
    back_off.succeeded();
    requests.push_back(now);
  }
  for (std::size_t i = 20; i < requests.size(); ++i) EXPECT_GT(requests[i] - requests[i - 20], 20min);
  EXPECT_GT(requests.size(), 80U);
}

}  // namespace
}  // namespace kiroku::recorder

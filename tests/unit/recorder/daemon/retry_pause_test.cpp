#include "recorder/daemon/retry_pause.h"

#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;

TEST(RetryPause, TriesAtOnceUntilSomethingFails) {
  const RetryPause fresh;
  EXPECT_TRUE(fresh.may_try(Clock::Time{}));
}

TEST(RetryPause, WaitsTwiceAsLongAfterEachFailureAndAMinuteAtMost) {
  RetryPause waiting;
  Clock::Time now(1h);
  for (const auto pause : {1s, 2s, 4s, 8s, 16s, 32s, 60s, 60s}) {
    waiting.failed(now);
    EXPECT_EQ(waiting.next_try(), "; the next try is in " + std::to_string(pause.count()) + " s");
    EXPECT_FALSE(waiting.may_try(now + pause - 1ns));
    EXPECT_TRUE(waiting.may_try(now + pause));
    now += pause;
  }
}

TEST(RetryPause, BeginsAnewAfterASuccess) {
  RetryPause waiting;
  waiting.failed(Clock::Time(1h));
  waiting.failed(Clock::Time(1h));
  waiting.succeeded();
  EXPECT_TRUE(waiting.may_try(Clock::Time(1h)));
  waiting.failed(Clock::Time(1h));
  EXPECT_TRUE(waiting.may_try(Clock::Time(1h + 1s)));
}

}  // namespace
}  // namespace kiroku::recorder

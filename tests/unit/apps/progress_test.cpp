#include "apps/common/progress.h"

#include <gtest/gtest.h>

namespace kiroku::apps {
namespace {

TEST(Progress, TellsShareRateAndTimeLeft) {
  EXPECT_EQ(progress_text("verifying", 420'000'000, 1'000'000'000, std::chrono::seconds(4)),
            "verifying  42 %  105 MB/s  0:05 left");
}

TEST(Progress, WithoutATotalTellsWhatIsDone) {
  EXPECT_EQ(progress_text("sealing", 3'000'000, 0, std::chrono::seconds(2)), "sealing  3.00 MB  1.50 MB/s");
}

TEST(Progress, PromisesNothingBeforeTheFirstByte) {
  EXPECT_EQ(progress_text("sealing", 0, 1000, std::chrono::seconds(2)), "sealing  0 %  0 B/s");
}

}  // namespace
}  // namespace kiroku::apps

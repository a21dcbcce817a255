#include "viewer/people/deed_pace.h"

#include <gtest/gtest.h>

namespace kiroku::viewer {
namespace {

using namespace std::chrono_literals;

class DeedPaceTest : public testing::Test {
 protected:
  /// How many of 1,000 deeds may be done now.
  std::size_t taken(const std::string& person) {
    std::size_t count = 0;
    for (int i = 0; i < 1000; ++i) count += pace.take(person, now).count() == 0 ? 1U : 0U;
    return count;
  }
  DeedPace pace{DeedPace::Limits{.at_once = 10, .each = 2s}};
  Clock::Time now{1000s};
};

TEST_F(DeedPaceTest, TakesSomeAtOnceAndThenOneAfterTheOther) {
  EXPECT_EQ(taken("user anna"), 10U);
  EXPECT_EQ(pace.take("user anna", now), 2s) << "says when the next one may be";
  now += 1999ms;
  EXPECT_EQ(taken("user anna"), 0U);
  now += 1ms;
  EXPECT_EQ(taken("user anna"), 1U);
  now += 7s;
  EXPECT_EQ(taken("user anna"), 3U);
  now += 1h;
  EXPECT_EQ(taken("user anna"), 10U);
}

TEST_F(DeedPaceTest, NobodyWaitsForAnother) {
  EXPECT_EQ(taken("user anna"), 10U);
  EXPECT_EQ(taken("user ben"), 10U);
  EXPECT_EQ(taken("invitation 1"), 10U);
}

}  // namespace
}  // namespace kiroku::viewer

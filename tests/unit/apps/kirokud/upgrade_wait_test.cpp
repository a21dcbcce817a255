#include "apps/kirokud/upgrade_wait.h"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/moved_clock.h"

namespace kiroku::apps {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

class UpgradeWaitTest : public testing::Test {
 protected:
  test::MovedClock time;
  bool is_kept = false, is_known = true;
  int asked = 0;
  std::vector<std::string> told;
  UpgradeWait wait{{.is_kept =
                        [this] {
                          ++asked;
                          return is_kept;
                        },
                    .is_known = [this] { return is_known; },
                    .tell = [this](const std::string& sentence) { told.push_back(sentence); }},
                   time};
};

TEST_F(UpgradeWaitTest, ThereIsNoneWhereAStartForgetsNothing) {
  is_kept = true;
  EXPECT_TRUE(wait.is_over());
  EXPECT_TRUE(told.empty());
}

TEST_F(UpgradeWaitTest, ThereIsNoneWhereNobodyIsKnown) {
  is_known = false;
  EXPECT_TRUE(wait.is_over());
  EXPECT_TRUE(told.empty());
}

TEST_F(UpgradeWaitTest, LastsUntilNobodyIsInTheRooms) {
  EXPECT_FALSE(wait.is_over());
  time.move(10h);
  EXPECT_FALSE(wait.is_over());
  ASSERT_EQ(told.size(), 1U) << "once";
  EXPECT_THAT(told[0],
              HasSubstr("takes over once no HL7 message tells of a patient of these rooms any more"));
  EXPECT_EQ(asked, 1);
  is_known = false;
  EXPECT_TRUE(wait.is_over());
}

TEST_F(UpgradeWaitTest, LastsNoLongerThanADay) {
  EXPECT_FALSE(wait.is_over());
  time.move(24h - 1s);
  EXPECT_FALSE(wait.is_over());
  time.move(1s);
  EXPECT_TRUE(wait.is_over());
}

}  // namespace
}  // namespace kiroku::apps

#include "recorder/vitals/handshake_pace.h"

#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;

class HandshakePaceTest : public testing::Test {
 protected:
  HandshakePace pace{{.free_failures = 16, .first_wait = 2s, .longest_wait = 30s, .memory = 10min}, 20};
  HandshakePace::Time now{1h};
};

TEST_F(HandshakePaceTest, OneMachineOfANetworkKeepsNoMonitorOut) {
  for (int i = 0; i < 40; ++i) pace.note_failure("fd00::bad", now);
  EXPECT_FALSE(pace.may_begin("fd00::bad", now));
  EXPECT_TRUE(pace.may_begin("fd00::2", now));
  now += 30s;
  EXPECT_TRUE(pace.may_begin("fd00::bad", now));
}

TEST_F(HandshakePaceTest, AddressesOfOneNetworkThatDeliveredNothingShareTwentyASecond) {
  int begun = 0;
  for (int i = 0; i < 1000; ++i) {
    const std::string address = "fd00::1:" + std::to_string(i);
    begun += pace.may_begin(address, now) ? 1 : 0;
    pace.note_failure(address, now);
  }
  EXPECT_EQ(begun, 20);
  EXPECT_FALSE(pace.may_begin("fd00::2", now));
  EXPECT_TRUE(pace.may_begin("fd00:0:0:1::2", now)) << "of another network";
  now += 1s;
  EXPECT_TRUE(pace.may_begin("fd00::2", now));
}

TEST_F(HandshakePaceTest, WhoDeliveredWaitsForNothing) {
  pace.note_message("fd00::2");
  for (int i = 0; i < 300; ++i) pace.note_failure("fd00::2", now);
  for (int i = 0; i < 300; ++i) EXPECT_TRUE(pace.may_begin("fd00::2", now));
  int begun = 0;
  for (int i = 0; i < 300; ++i) begun += pace.may_begin("fd00::3", now) ? 1 : 0;
  EXPECT_EQ(begun, 20) << "which is only a neighbour of one that delivered";
}

TEST_F(HandshakePaceTest, RemembersNotMoreNetworksThanItMust) {
  for (int i = 0; i < 100'000; ++i) {
    now += 1ms;
    EXPECT_TRUE(pace.may_begin("fd00:" + std::to_string(i % 10'000) + "::2", now));
  }
}

}  // namespace
}  // namespace kiroku::recorder

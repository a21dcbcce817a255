#include "recorder/vitals/handshake_pace.h"

#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;

class HandshakePaceTest : public testing::Test {
 protected:
  HandshakePace pace{{.free_failures = 16, .first_wait = 2s, .longest_wait = 30s, .memory = 10min},
                     {.free_failures = 256, .first_wait = 1s, .longest_wait = 1s, .memory = 10min}};
  HandshakePace::Time now{1h};
};

TEST_F(HandshakePaceTest, OneMachineOfANetworkKeepsNoMonitorOut) {
  for (int i = 0; i < 40; ++i) pace.note_failure("fd00::bad", now);
  EXPECT_TRUE(pace.must_wait("fd00::bad", now));
  EXPECT_FALSE(pace.must_wait("fd00::2", now));
  now += 30s;
  EXPECT_FALSE(pace.must_wait("fd00::bad", now));
}

TEST_F(HandshakePaceTest, WhoTakesAnotherAddressEachTimeIsSlowedDownForASecondAtATime) {
  for (int i = 0; i < 300; ++i) pace.note_failure("fd00::1:" + std::to_string(i), now);
  EXPECT_TRUE(pace.must_wait("fd00::2:1", now));
  EXPECT_TRUE(pace.must_wait("fd00::2", now));
  EXPECT_FALSE(pace.must_wait("fd00:0:0:1::2", now)) << "of another network";
  now += 1s;
  EXPECT_FALSE(pace.must_wait("fd00::2", now));
}

TEST_F(HandshakePaceTest, WhoDeliveredWaitsForNothing) {
  pace.note_message("fd00::2");
  for (int i = 0; i < 300; ++i) pace.note_failure("fd00::bad", now);
  for (int i = 0; i < 300; ++i) pace.note_failure("fd00::2", now);
  EXPECT_FALSE(pace.must_wait("fd00::2", now));
  EXPECT_TRUE(pace.must_wait("fd00::3", now)) << "which only is a neighbour of one that did";
}

}  // namespace
}  // namespace kiroku::recorder

#include "base/tally.h"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku {
namespace {

TEST(Tally, TellsEverMoreRarely) {
  Tally tally;
  std::vector<std::uint64_t> told;
  for (int i = 0; i < 100; ++i) {
    if (const auto count = tally.add("192.0.2.7")) told.push_back(*count);
  }
  EXPECT_THAT(told, testing::ElementsAre(1, 2, 4, 8, 16, 32, 64));
  EXPECT_EQ(tally.add("192.0.2.8"), 1U);
  EXPECT_EQ(tally.total(), 101U);
}

TEST(Tally, TellsNoMoreOfManyKeysThanOfOne) {
  Tally tally(10);
  int told = 0;
  for (int i = 0; i < 1010; ++i) told += tally.add(std::to_string(i)) ? 1 : 0;
  EXPECT_EQ(told, 10 + 10) << "ten keys, and 1, 2, 4, … 512 of the others";
  EXPECT_EQ(tally.total(), 1010U);
}

}  // namespace
}  // namespace kiroku

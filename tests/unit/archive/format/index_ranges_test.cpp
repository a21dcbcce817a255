#include "archive/format/index_ranges.h"

#include <random>
#include <set>

#include <gtest/gtest.h>

namespace kiroku::archive {
namespace {

TEST(IndexRanges, HoldWhatASetHolds) {
  std::mt19937_64 random(7);
  for (int round = 0; round < 200; ++round) {
    IndexRanges ranges;
    std::set<std::uint64_t> all;
    for (int i = 0; i < 20; ++i) {
      const std::uint64_t first = random() % 60;
      const std::uint64_t last = first + random() % 6;
      ranges.add(first, last);
      for (std::uint64_t each = first; each <= last; ++each) {
        all.insert(each);
      }
      std::size_t runs = 0;
      for (std::uint64_t number = 0; number < 80; ++number) {
        ASSERT_EQ(ranges.contains(number), all.contains(number)) << number;
        runs += all.contains(number) && !all.contains(number + 1) ? 1U : 0U;
      }
      ASSERT_EQ(ranges.ranges(), runs);
    }
  }
}

TEST(IndexRanges, AreOneWhereTheyTouchInWhateverOrder) {
  IndexRanges ranges;
  for (std::uint64_t number = 100'000; number > 0; number -= 2) {
    ranges.add(number, number);
  }
  EXPECT_EQ(ranges.ranges(), 50'000U);
  for (std::uint64_t number = 1; number < 100'000; number += 2) {
    ranges.add(number, number);
  }
  EXPECT_EQ(ranges.ranges(), 1U);
  EXPECT_FALSE(ranges.contains(0));
  EXPECT_TRUE(ranges.contains(1));
  EXPECT_TRUE(ranges.contains(100'000));
  EXPECT_FALSE(ranges.contains(100'001));
}

}  // namespace
}  // namespace kiroku::archive

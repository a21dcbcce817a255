#include "viewer/study/order.h"

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::study {
namespace {

RandomBelow seeded(unsigned seed) {
  auto random = std::make_shared<std::mt19937>(seed);
  return [random](std::size_t count) {
    return std::uniform_int_distribution<std::size_t>(0, count - 1)(*random);
  };
}

using Counts = std::map<std::pair<std::size_t, std::size_t>, int>;

TEST(StudyOrder, ShowsEachClipInEachCodingOnceAndSomeAgain) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    constexpr std::size_t kClips = 6, kCodings = 3, kRepeats = 5, kAll = kClips * kCodings;
    const std::vector<Place> order = make_order(kClips, kCodings, kRepeats, seeded(seed));
    ASSERT_EQ(order.size(), kAll + kRepeats);
    Counts seen;
    std::map<std::size_t, int> again_of_coding;
    for (std::size_t at = 0; at < order.size(); ++at) {
      const int times = ++seen[{order[at].clip, order[at].coding}];
      ASSERT_LE(times, 2);
      if (times == 2) {
        ++again_of_coding[order[at].coding];
        EXPECT_GE(at, kAll / 2) << "what is seen again comes in the second half";
      }
      if (at == 0) continue;
      EXPECT_NE(order[at].clip, order[at - 1].clip) << "seed " << seed << ", place " << at;
    }
    EXPECT_EQ(seen.size(), kAll);
    for (std::size_t coding = 0; coding < kCodings; ++coding) {
      EXPECT_GE(again_of_coding[coding], 1) << "seed " << seed;
      EXPECT_LE(again_of_coding[coding], 2) << "seed " << seed;
    }
  }
}

TEST(StudyOrder, BalancesCodingsOverTheReading) {
  for (unsigned seed = 0; seed < 100; ++seed) {
    constexpr std::size_t kClips = 7, kCodings = 4;
    const std::vector<Place> order = make_order(kClips, kCodings, 0, seeded(seed));
    for (std::size_t block = 0; block < kCodings; ++block) {
      std::map<std::size_t, int> of_coding;
      std::set<std::size_t> clips;
      for (std::size_t i = 0; i < kClips; ++i) {
        ++of_coding[order[block * kClips + i].coding];
        clips.insert(order[block * kClips + i].clip);
      }
      EXPECT_EQ(clips.size(), kClips);
      for (std::size_t coding = 0; coding < kCodings; ++coding) {
        EXPECT_GE(of_coding[coding], 1);
        EXPECT_LE(of_coding[coding], 2);
      }
    }
  }
}

TEST(StudyOrder, PutsEveryFilmEverywhere) {
  // Where the film of the first clip in the first coding comes, over many orders: as often in each place.
  constexpr std::size_t kClips = 3, kCodings = 2, kAll = kClips * kCodings;
  constexpr int kOrders = 6000;
  std::array<int, kAll> places{};
  const RandomBelow random = seeded(7);
  for (int i = 0; i < kOrders; ++i) {
    const std::vector<Place> order = make_order(kClips, kCodings, 0, random);
    ++places.at(static_cast<std::size_t>(std::ranges::find(order, Place{0, 0}) - order.begin()));
  }
  // 1000 each, and a standard deviation of 29; what keeps a clip from following itself shifts some.
  for (const int count : places) EXPECT_NEAR(count, kOrders / kAll, 250);
}

TEST(StudyOrder, TakesOneClipAndOneFilm) {
  EXPECT_EQ(make_order(1, 1, 0, seeded(1)).size(), 1U);
  EXPECT_EQ(make_order(1, 4, 2, seeded(1)).size(), 6U);
  EXPECT_EQ(make_order(2, 2, 2, seeded(1)).size(), 6U);
  EXPECT_THROW(make_order(2, 2, 3, seeded(1)), UsageError);
}

TEST(StudyOrder, IsAnotherForEachReader) {
  std::set<std::string> orders;
  for (int i = 0; i < 20; ++i) {
    std::string text;
    for (const Place& place : make_order(6, 2, 2, system_random()))
      text += std::to_string(place.clip) + "/" + std::to_string(place.coding) + " ";
    orders.insert(text);
  }
  EXPECT_EQ(orders.size(), 20U);
}

TEST(StudyOrder, DrawsFairly) {
  const RandomBelow random = system_random();
  std::array<int, 5> drawn{};
  for (int i = 0; i < 5000; ++i) ++drawn.at(random(5));
  for (const int count : drawn) EXPECT_NEAR(count, 1000, 200);  // seven standard deviations
  EXPECT_EQ(random(1), 0U);
}

TEST(StudyOrder, MakesNamesThatTellNothing) {
  EXPECT_THAT(reader_code(system_random()), testing::MatchesRegex("[2-9A-HJKMNP-Z]{4}-[2-9A-HJKMNP-Z]{4}"));
  EXPECT_NE(random_name(8), random_name(8));
  EXPECT_THAT(random_name(8), testing::MatchesRegex("[0-9a-f]{16}"));
}

}  // namespace
}  // namespace kiroku::study

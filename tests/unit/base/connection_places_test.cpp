#include "base/connection_places.h"

#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku {
namespace {

using Standing = ConnectionPlaces::Standing;
using testing::ElementsAre;
using testing::IsEmpty;

class ConnectionPlacesTest : public testing::Test {
 protected:
  std::unique_ptr<ConnectionPlaces::Place> enter(ConnectionPlaces& places, const std::string& holder,
                                                 const std::string& name) {
    return places.enter(holder, [this, name] { ended.push_back(name); });
  }
  std::vector<std::string> ended;
};

TEST_F(ConnectionPlacesTest, LetTheIdlestGoFirst) {
  ConnectionPlaces places({.all = 3, .of_holder = 3});
  const auto first = enter(places, "a", "first");
  const auto second = enter(places, "b", "second");
  const auto third = enter(places, "c", "third");
  first->note(Standing::kSilent);
  const auto fourth = enter(places, "d", "fourth");
  ASSERT_NE(fourth, nullptr);
  EXPECT_THAT(ended, ElementsAre("second"));
  EXPECT_EQ(places.count(), 3U);
}

TEST_F(ConnectionPlacesTest, LetSilentOnesGoBeforeThoseThatSpoke) {
  ConnectionPlaces places({.all = 2, .of_holder = 2});
  const auto spoke = enter(places, "a", "spoke");
  spoke->note(Standing::kSpoken);
  std::vector<std::unique_ptr<ConnectionPlaces::Place>> silent;
  for (int i = 0; i < 300; ++i) silent.push_back(enter(places, "s" + std::to_string(i), "silent"));
  EXPECT_EQ(ended, std::vector<std::string>(299, "silent"));
  const auto other = enter(places, "b", "other");
  other->note(Standing::kSpoken);
  ASSERT_NE(enter(places, "c", "newcomer"), nullptr);
  EXPECT_EQ(ended.back(), "spoke") << "nobody is silent any more";
}

TEST_F(ConnectionPlacesTest, NeverTakeThePlaceOfTheKnownOrTheBusy) {
  ConnectionPlaces places({.all = 2, .of_holder = 2});
  const auto known = enter(places, "a", "known");
  known->note(Standing::kKnown);
  const auto busy = enter(places, "b", "busy");
  busy->set_busy(true);
  EXPECT_EQ(enter(places, "c", "newcomer"), nullptr);
  EXPECT_THAT(ended, IsEmpty());
  busy->set_busy(false);
  EXPECT_NE(enter(places, "c", "newcomer"), nullptr);
  EXPECT_THAT(ended, ElementsAre("busy"));
}

TEST_F(ConnectionPlacesTest, TakeOneOfItsOwnWhereAHolderHasMany) {
  ConnectionPlaces places({.all = 10, .of_holder = 2});
  const auto elsewhere = enter(places, "b", "elsewhere");
  const auto first = enter(places, "a", "first");
  const auto second = enter(places, "a", "second");
  const auto third = enter(places, "a", "third");
  EXPECT_THAT(ended, ElementsAre("first"));
  second->note(Standing::kKnown);
  third->note(Standing::kKnown);
  EXPECT_EQ(enter(places, "a", "fourth"), nullptr);
  EXPECT_NE(enter(places, "c", "other"), nullptr);
}

TEST_F(ConnectionPlacesTest, AreGivenBackOnce) {
  ConnectionPlaces places({.all = 1, .of_holder = 1});
  auto first = enter(places, "a", "first");
  auto second = enter(places, "a", "second");
  first->note(Standing::kKnown);
  first.reset();
  EXPECT_EQ(places.count(), 1U) << "what made room counts no more";
  second.reset();
  EXPECT_EQ(places.count(), 0U);
  EXPECT_THAT(ended, ElementsAre("first"));
}

TEST_F(ConnectionPlacesTest, HoldTheirLimitsWhoeverCallsFromWhichThread) {
  ConnectionPlaces places({.all = 20, .of_holder = 7});
  std::vector<std::thread> threads;
  for (int thread = 0; thread < 4; ++thread) {
    threads.emplace_back([&places, thread] {
      std::vector<std::unique_ptr<ConnectionPlaces::Place>> mine;
      for (int i = 0; i < 500; ++i) {
        mine.push_back(places.enter(std::to_string(thread), [] {}));
        ASSERT_NE(mine.back(), nullptr);
        mine.back()->note(Standing::kSpoken);
        EXPECT_LE(places.count(), 20U);
        if (i % 3 == 0) mine.erase(mine.begin());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(places.count(), 0U);
}

}  // namespace
}  // namespace kiroku

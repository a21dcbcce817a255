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

TEST_F(ConnectionPlacesTest, TakeFromTheOwnerOfTheMostWhereNobodyElseIsThere) {
  ConnectionPlaces places({.all = 9, .of_holder = 9, .kept_of_owner = 2});
  std::vector<std::unique_ptr<ConnectionPlaces::Place>> held;
  const auto known = [&](const std::string& owner, const std::string& name) {
    held.push_back(enter(places, "h", name));
    ASSERT_NE(held.back(), nullptr) << name;
    held.back()->note_known(owner);
  };
  for (const char* name : {"a1", "a2", "a3", "a4", "a5", "a6"}) known("a", name);
  for (const char* name : {"b1", "b2", "b3"}) known("b", name);
  // One that is busy goes last of its owner's.
  held[0]->set_busy(true);
  for (const char* name : {"c1", "c2"}) known("c", name);
  EXPECT_THAT(ended, ElementsAre("a2", "a3"));
  known("d", "d1");
  known("d", "d2");
  EXPECT_THAT(ended, ElementsAre("a2", "a3", "a4", "a5")) << "whoever has the most";
  known("e", "e1");
  EXPECT_EQ(ended.size(), 5U);
  EXPECT_EQ(enter(places, "h", "newcomer"), nullptr) << "nobody has more than is kept";
}

TEST_F(ConnectionPlacesTest, LeaveSomeForOthersThanTheKnown) {
  ConnectionPlaces places({.all = 100, .of_holder = 16, .kept_of_owner = 2, .one_for_others_in = 8});
  std::vector<std::unique_ptr<ConnectionPlaces::Place>> known;
  for (int i = 0; i < 16; ++i) {
    known.push_back(enter(places, "h", "known"));
    known.back()->note_known("a");
  }
  const auto first = enter(places, "h", "first"), second = enter(places, "h", "second");
  EXPECT_THAT(ended, ElementsAre("known", "known")) << "two of sixteen";
  const auto third = enter(places, "h", "third");
  EXPECT_THAT(ended, ElementsAre("known", "known", "first")) << "then they take from each other";
  EXPECT_NE(enter(places, "elsewhere", "other"), nullptr);
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

#include "viewer/server/costly_work.h"

#include <future>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::viewer {
namespace {

using testing::ElementsAre;

/// One thread, held until it is released; what is done then stands in `done` in its order.
class CostlyWorkTest : public testing::Test {
 protected:
  /// Occupies the thread, and returns when it does.
  void hold() {
    std::promise<void> begun;
    ASSERT_TRUE(work.offer(false, "holder", [&begun, release = released.get_future().share()] {
      begun.set_value();
      release.wait();
    }));
    begun.get_future().wait();
  }
  bool offer(bool goes_first, const std::string& who, const std::string& name) {
    return work.offer(goes_first, who, [this, name] { done.push_back(name); });
  }
  /// Lets the thread go and waits until it has done everything.
  void finish() {
    released.set_value();
    std::promise<void> last;
    while (!work.offer(false, "last", [&last] { last.set_value(); })) std::this_thread::yield();
    last.get_future().wait();
  }

  std::promise<void> released;
  std::vector<std::string> done;  // touched by the only thread
  CostlyWork work{{.threads = 1, .waiting = 3, .of_one = 2}};
};

TEST_F(CostlyWorkTest, IsDoneInOrderButForWhatGoesFirst) {
  hold();
  EXPECT_TRUE(offer(false, "a", "first stranger"));
  EXPECT_TRUE(offer(false, "b", "second stranger"));
  EXPECT_TRUE(offer(true, "c", "known"));
  finish();
  EXPECT_THAT(done, ElementsAre("known", "first stranger", "second stranger"));
}

TEST_F(CostlyWorkTest, IsRefusedAtOnceWhereAsMuchWaitsAsMay) {
  hold();
  for (const char* who : {"a", "b", "c"}) EXPECT_TRUE(offer(false, who, who));
  EXPECT_FALSE(offer(false, "d", "d"));
  EXPECT_TRUE(offer(true, "known", "known")) << "who goes first waits elsewhere";
  finish();
  EXPECT_THAT(done, ElementsAre("known", "a", "b", "c"));
}

TEST_F(CostlyWorkTest, LeavesRoomForOthersThanTheOneWhoAsksOften) {
  hold();
  EXPECT_TRUE(offer(false, "a", "one"));
  EXPECT_TRUE(offer(false, "a", "two"));
  EXPECT_FALSE(offer(false, "a", "three"));
  EXPECT_FALSE(offer(true, "a", "three"));
  EXPECT_TRUE(offer(false, "b", "other"));
  finish();
  EXPECT_THAT(done, ElementsAre("one", "two", "other"));
}

TEST(CostlyWorkOfMany, NeverKeepsEveryThreadForOneWhoAsksTwice) {
  CostlyWork work({.threads = 2, .waiting = 4, .of_one = 3});
  std::promise<void> released;
  const std::shared_future<void> release = released.get_future().share();
  const auto held = [&](std::promise<void>& done) {
    return [&done, release] {
      release.wait();
      done.set_value();
    };
  };
  std::promise<void> first, second, other;
  ASSERT_TRUE(work.offer(true, "a", held(first)));
  ASSERT_TRUE(work.offer(true, "a", held(second)));
  ASSERT_TRUE(work.offer(false, "b", [&other] { other.set_value(); }));
  std::future<void> of_other = other.get_future();
  EXPECT_EQ(of_other.wait_for(std::chrono::seconds(60)), std::future_status::ready)
      << "though it came last, and does not go first";
  released.set_value();
  first.get_future().wait();
  second.get_future().wait();
}

TEST_F(CostlyWorkTest, DropsWhatWaitsWhenItStops) {
  hold();
  const auto kept = std::make_shared<int>(1);
  EXPECT_TRUE(work.offer(false, "a", [this, kept] { done.push_back("waiting"); }));
  std::thread stopper([this] { work.stop(); });
  released.set_value();
  stopper.join();
  EXPECT_EQ(kept.use_count(), 1);
  EXPECT_FALSE(offer(false, "b", "late"));
}

}  // namespace
}  // namespace kiroku::viewer

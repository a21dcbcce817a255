#include "apps/kirokud/kept_server.h"

#include <atomic>
#include <mutex>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/eventually.h"
#include "tests/support/moved_clock.h"

namespace kiroku::apps {
namespace {

using test::eventually;
using testing::ElementsAre;

struct Server {};

class KeptServerTest : public testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<KeptServer<Server>> kept() {
    return std::make_unique<KeptServer<Server>>(
        "the page",
        [this] {
          ++attempts_;
          const std::lock_guard guard(mutex_);
          if (!why_not_.empty()) throw Error(why_not_);
          return std::make_unique<Server>();
        },
        KeptServerListener{.without = [this](const std::string& each) { told_.push_back("+ " + each); },
                           .no_more = [this](const std::string& each) { told_.push_back("- " + each); }},
        clock_);
  }
  void fails_for(const std::string& why) {
    const std::lock_guard guard(mutex_);
    why_not_ = why;
  }
  /// A later attempt is begun and taken notice of.
  [[nodiscard]] bool is_tried_again(KeptServer<Server>& server) {
    const int before = attempts_;
    const std::size_t told = told_.size();
    clock_.move(std::chrono::seconds(90));
    return eventually([&] {
      server.tend();
      return attempts_ > before && (server.is_there() || told_.size() > told);
    });
  }

  test::MovedClock clock_;
  std::atomic<int> attempts_ = 0;
  std::vector<std::string> told_;

 private:
  std::mutex mutex_;
  std::string why_not_;
};

TEST_F(KeptServerTest, ThatIsThereIsLeftAlone) {
  const auto server = kept();
  EXPECT_TRUE(server->is_there());
  clock_.move(std::chrono::hours(1));
  server->tend();
  EXPECT_EQ(attempts_, 1);
  EXPECT_THAT(told_, testing::IsEmpty());
}

TEST_F(KeptServerTest, ComesWhenItsPortIsFree) {
  fails_for("port 80 is taken");
  const auto server = kept();
  EXPECT_THAT(told_, ElementsAre("+ recording goes on without the page: port 80 is taken"));
  clock_.move(std::chrono::seconds(1));
  server->tend();
  EXPECT_EQ(attempts_, 1) << "not so soon";
  fails_for("");
  ASSERT_TRUE(is_tried_again(*server));
  EXPECT_TRUE(server->is_there());
  EXPECT_THAT(told_, ElementsAre("+ recording goes on without the page: port 80 is taken",
                                 "- recording goes on without the page: port 80 is taken"));
}

TEST_F(KeptServerTest, SaysWhatKeepsItOnceAndWhatKeepsItThen) {
  fails_for("port 80 is taken");
  const auto server = kept();
  clock_.move(std::chrono::seconds(90));
  EXPECT_TRUE(eventually([&] {
    server->tend();
    return attempts_ == 2;
  }));
  EXPECT_EQ(told_.size(), 1U);
  fails_for("no certificate");
  ASSERT_TRUE(eventually([&] {
    clock_.move(std::chrono::seconds(90));
    server->tend();
    return told_.size() > 1;
  }));
  EXPECT_THAT(told_, ElementsAre("+ recording goes on without the page: port 80 is taken",
                                 "- recording goes on without the page: port 80 is taken",
                                 "+ recording goes on without the page: no certificate"));
}

TEST_F(KeptServerTest, ThatNobodyAskedForIsNeverOpened) {
  KeptServer<Server> server("the page", {}, {}, clock_);
  server.tend();
  EXPECT_FALSE(server.is_there());
}

}  // namespace
}  // namespace kiroku::apps

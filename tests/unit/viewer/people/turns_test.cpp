#include "viewer/people/turns.h"

#include <future>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/moved_clock.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

using namespace std::chrono_literals;
using Turn = Turns::Turn;

class TurnsTest : public testing::Test {
 protected:
  /// What whoever asks for a turn is told in the end; empty where they had one.
  std::string asks(const std::string& person) {
    try {
      const Turn turn(turns, person);
      return "";
    } catch (const Refusal& refusal) {
      return refusal.what();
    }
  }
  std::future<std::string> asks_beside(const std::string& person) {
    return std::async(std::launch::async, [this, person] { return asks(person); });
  }

  test::MovedClock clock;
  Turns turns{{.all = 2, .of_person = 1, .patience = 5s}, {"all are taken", "you have one"}, clock};
};

TEST_F(TurnsTest, WaitsForATurnThatIsGivenBack) {
  auto first = std::make_unique<Turn>(turns, "anna");
  std::future<std::string> again = asks_beside("anna");
  clock.await_waiting(1);
  EXPECT_EQ(asks("ben"), "") << "who waits takes no turn of others";
  clock.move(4999ms);
  first.reset();
  EXPECT_EQ(again.get(), "");
}

TEST_F(TurnsTest, RefusesWhenNoneWasGivenBack) {
  const Turn first(turns, "anna");
  std::future<std::string> again = asks_beside("anna");
  clock.await_waiting(1);
  clock.move(5s);
  EXPECT_EQ(again.get(), "you have one");
}

TEST_F(TurnsTest, NobodyWaitsForOthers) {
  const Turn first(turns, "anna"), second(turns, "ben");
  EXPECT_EQ(asks("cara"), "all are taken");
}

TEST_F(TurnsTest, TheNewestWaitOfAPersonGoesOnAlone) {
  auto first = std::make_unique<Turn>(turns, "anna");
  std::future<std::string> left = asks_beside("anna");
  clock.await_waiting(1);
  std::future<std::string> shown = asks_beside("anna");
  EXPECT_EQ(left.get(), "you have one");
  clock.await_waiting(1);
  first.reset();
  EXPECT_EQ(shown.get(), "");
}

TEST(Turns, RefuseAtOnceWithoutPatience) {
  test::MovedClock clock;
  Turns turns({.all = 1, .of_person = 1, .patience = {}}, {"all are taken", "you have one"}, clock);
  const Turn first(turns, "anna");
  EXPECT_THROW(Turn(turns, "anna"), Refusal);
  EXPECT_THROW(Turn(turns, "ben"), Refusal);
}

}  // namespace
}  // namespace kiroku::viewer

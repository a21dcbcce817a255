#include "fleet/reports/request_budget.h"

#include <gtest/gtest.h>

#include "tests/support/moved_clock.h"

namespace kiroku::fleet {
namespace {

using namespace std::chrono_literals;

TEST(RequestBudget, EachHasItsOwnInEachWindow) {
  test::MovedClock clock;
  RequestBudget budget(3, 60s, 10, clock);
  for (int minute = 0; minute < 3; ++minute) {
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(budget.take("hog"));
    for (int i = 0; i < 100; ++i) EXPECT_FALSE(budget.take("hog"));
    EXPECT_TRUE(budget.take("or-1"));
    clock.move(60s);
  }
}

TEST(RequestBudget, RemembersSoManyNamesAndNoMore) {
  test::MovedClock clock;
  RequestBudget budget(3, 60s, 2, clock);
  EXPECT_TRUE(budget.take("or-1"));
  EXPECT_TRUE(budget.take("or-2"));
  EXPECT_FALSE(budget.take("or-3"));
  EXPECT_TRUE(budget.take("or-1"));
  clock.move(60s);
  EXPECT_TRUE(budget.take("or-3"));
}

}  // namespace
}  // namespace kiroku::fleet

#include "recorder/daemon/schedule.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

enum Day { kSunday, kMonday, kTuesday, kWednesday, kThursday, kFriday, kSaturday };

std::tm at(Day day, int hour, int minute) {
  std::tm time{};
  time.tm_wday = day;
  time.tm_hour = hour;
  time.tm_min = minute;
  return time;
}

TEST(Schedule, HoldsItsFirstMinuteAndNotItsLast) {
  const Schedule schedule = Schedule::parse({"mon-fri 07:30-16:00"});
  EXPECT_FALSE(schedule.contains(at(kMonday, 7, 29)));
  EXPECT_TRUE(schedule.contains(at(kMonday, 7, 30)));
  EXPECT_TRUE(schedule.contains(at(kFriday, 15, 59)));
  EXPECT_FALSE(schedule.contains(at(kFriday, 16, 0)));
  EXPECT_FALSE(schedule.contains(at(kSaturday, 10, 0)));
}

TEST(Schedule, WindowOverMidnightBelongsToTheDayItBegins) {
  const Schedule schedule = Schedule::parse({"sat 22:00-06:00"});
  EXPECT_TRUE(schedule.contains(at(kSaturday, 23, 0)));
  EXPECT_TRUE(schedule.contains(at(kSunday, 5, 59)));
  EXPECT_FALSE(schedule.contains(at(kSunday, 6, 0)));
  EXPECT_FALSE(schedule.contains(at(kSunday, 22, 30)));
  EXPECT_FALSE(schedule.contains(at(kSaturday, 5, 0)));
}

TEST(Schedule, TakesListsRangesOverTheWeekendAndWholeDays) {
  const Schedule schedule = Schedule::parse({"fri-mon,wed 00:00-24:00", "tue 01:00-02:00"});
  EXPECT_TRUE(schedule.contains(at(kSunday, 0, 0)));
  EXPECT_TRUE(schedule.contains(at(kMonday, 23, 59)));
  EXPECT_TRUE(schedule.contains(at(kWednesday, 12, 0)));
  EXPECT_FALSE(schedule.contains(at(kThursday, 12, 0)));
  EXPECT_TRUE(schedule.contains(at(kTuesday, 1, 30)));
  EXPECT_TRUE(Schedule::parse({"daily 09:00-10:00"}).contains(at(kThursday, 9, 0)));
}

TEST(Schedule, RefusesWhatIsNoWindow) {
  for (const char* text : {"", "mon", "mon 07:30", "mon 7:30-8:00", "mon 07:30-25:00", "mun 07:30-08:00",
                           "mon- 07:30-08:00", "mon 24:00-01:00", "mon 07:60-08:00", "mon,,tue 07:30-08:00",
                           "mon 07:30-24:01", "mon  07:30-08:00", "mon 07:30-08:00 "}) {
    EXPECT_THROW(Schedule::parse({text}), UsageError) << text;
  }
}

}  // namespace
}  // namespace kiroku::recorder

#include "recorder/daemon/room_rules.h"

#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;

/// A moment at which this machine's clock on the wall shows the hour, in 2026.
UtcTime at_local(int day, int hour) {
  std::tm wall{};
  wall.tm_year = 126;
  wall.tm_mon = 5;
  wall.tm_mday = day;
  wall.tm_hour = hour;
  wall.tm_isdst = -1;
  return UtcTime(std::chrono::seconds(std::mktime(&wall)));
}

/// Of one camera, whose last picture ends at `last`.
SessionStatus status_of(std::chrono::nanoseconds now, std::chrono::nanoseconds last) {
  SessionStatus status;
  status.now_ns = now.count();
  StreamStatus& camera = status.streams.emplace_back();
  camera.name = "endoscope";
  camera.frames = 1;
  camera.last_ns = last.count();
  return status;
}

TEST(StartRules, WindowBeginsACaseUntilAPersonEndsOne) {
  RoomRules rules;
  rules.schedule = Schedule::parse({"daily 08:00-12:00"});
  StartRules start(rules);
  EXPECT_FALSE(start.schedule_wants_a_case(at_local(10, 7)));
  EXPECT_TRUE(start.schedule_wants_a_case(at_local(10, 9)));
  start.stopped_by_person();
  EXPECT_FALSE(start.schedule_wants_a_case(at_local(10, 10)));
  EXPECT_FALSE(start.schedule_wants_a_case(at_local(10, 13)));
  EXPECT_TRUE(start.schedule_wants_a_case(at_local(11, 9))) << "the next window";
}

TEST(StartRules, NoScheduleWantsNothing) {
  const RoomRules rules;
  EXPECT_FALSE(StartRules(rules).schedule_wants_a_case(at_local(10, 9)));
}

TEST(StartRules, SignalMustLastWithoutAPause) {
  RoomRules rules;
  rules.start_on_signal = "endoscope";
  StartRules start(rules);
  EXPECT_FALSE(start.signal_wants_a_case(status_of(5s, 5s)));
  EXPECT_FALSE(start.signal_wants_a_case(status_of(7s, 7s)));
  EXPECT_FALSE(start.signal_wants_a_case(status_of(8s, 7s))) << "a pause of a second";
  EXPECT_FALSE(start.signal_wants_a_case(status_of(9s, 9s)));
  EXPECT_FALSE(start.signal_wants_a_case(status_of(11s, 11s)));
  EXPECT_TRUE(start.signal_wants_a_case(status_of(12s, 12s)));
}

TEST(StartRules, SignalAfterAPersonsEndBeginsACaseOnceItHasPaused) {
  RoomRules rules;
  rules.start_on_signal = "endoscope";
  StartRules start(rules);
  start.stopped_by_person();
  EXPECT_FALSE(start.signal_wants_a_case(status_of(1s, 1s)));
  EXPECT_FALSE(start.signal_wants_a_case(status_of(9s, 9s)));
  EXPECT_FALSE(start.signal_wants_a_case(status_of(11s, 9s)));
  EXPECT_FALSE(start.signal_wants_a_case(status_of(12s, 12s)));
  EXPECT_TRUE(start.signal_wants_a_case(status_of(15s, 15s)));
}

/// The same, before its first picture.
SessionStatus opening_status_of(std::chrono::nanoseconds now) {
  SessionStatus status = status_of(now, 0s);
  status.streams[0].frames = 0;
  return status;
}

TEST(StartRules, ASourceThatAnotherSessionOpensIsNoSignalThatCameBack) {
  RoomRules rules;
  rules.start_on_signal = "endoscope";
  StartRules start(rules);
  start.stopped_by_person();
  start.forget_signal();
  EXPECT_FALSE(start.signal_wants_a_case(opening_status_of(0s)));
  EXPECT_FALSE(start.signal_wants_a_case(opening_status_of(4s)));
  EXPECT_FALSE(start.signal_wants_a_case(status_of(5s, 5s)));
  EXPECT_FALSE(start.signal_wants_a_case(status_of(60s, 60s))) << "it was there all the time";
}

TEST(StartRules, ASourceThatASessionCannotOpenIsAwayAndANextSignalBeginsACase) {
  RoomRules rules;
  rules.start_on_signal = "endoscope";
  StartRules start(rules);
  start.stopped_by_person();
  start.forget_signal();
  EXPECT_FALSE(start.signal_wants_a_case(opening_status_of(10s)));
  EXPECT_FALSE(start.signal_wants_a_case(status_of(11s, 11s)));
  EXPECT_TRUE(start.signal_wants_a_case(status_of(14s, 14s)));
}

TEST(StartRules, PicturesThatASlowDiskKeepsWaitingAreNoPauseThatEndsARest) {
  RoomRules rules;
  rules.start_on_signal = "endoscope";
  StartRules start(rules);
  start.stopped_by_person();
  SessionStatus slow = status_of(9s, 6s);
  slow.streams[0].live = true;
  EXPECT_FALSE(start.signal_wants_a_case(slow));
  EXPECT_FALSE(start.signal_wants_a_case(status_of(10s, 10s)));
  EXPECT_FALSE(start.signal_wants_a_case(status_of(60s, 60s)));
}

TEST(StartRules, AnotherSessionsSignalIsCountedFromItsBeginning) {
  RoomRules rules;
  rules.start_on_signal = "endoscope";
  StartRules start(rules);
  EXPECT_FALSE(start.signal_wants_a_case(status_of(0s, 0s)));
  start.forget_signal();
  EXPECT_FALSE(start.signal_wants_a_case(status_of(4s, 4s)));
  EXPECT_TRUE(start.signal_wants_a_case(status_of(7s, 7s)));
}

TEST(StartRules, OtherStreamsAreNoSignal) {
  RoomRules rules;
  rules.start_on_signal = "room";
  StartRules start(rules);
  EXPECT_FALSE(start.signal_wants_a_case(status_of(0s, 0s)));
  EXPECT_FALSE(start.signal_wants_a_case(status_of(60s, 60s)));
}

TEST(RuleToEnd, LongestCaseCountsTheOperationsEarlierCases) {
  RoomRules rules;
  rules.longest_case = 2h;
  SessionStatus status = status_of(90min, 90min);
  status.begins_ns = std::chrono::nanoseconds(10min).count();
  EXPECT_EQ(rule_to_end(rules, {status, false, 0h, 1}, at_local(10, 9)), "");
  EXPECT_EQ(rule_to_end(rules, {status, false, 40min, 1}, at_local(10, 9)), "longest-case");
}

TEST(RuleToEnd, SilenceIsThatOfThePictures) {
  RoomRules rules;
  rules.stop_after_silence = 60s;
  SessionStatus status = status_of(200s, 130s);
  status.streams.push_back({});  // vital signs that go on
  status.streams[1].name = "vitals";
  status.streams[1].last_ns = status.now_ns;
  EXPECT_EQ(rule_to_end(rules, {status, false, 0h, 1}, at_local(10, 9)), "silence");
  EXPECT_EQ(rule_to_end(rules, {status, false, 0h, 0}, at_local(10, 9)), "") << "a case of vital signs alone";
  status.decided_ns = std::chrono::nanoseconds(150s).count();
  EXPECT_EQ(rule_to_end(rules, {status, false, 0h, 1}, at_local(10, 9)), "")
      << "silence from before somebody began the case";
}

TEST(RuleToEnd, WindowEndsTheCasesThatItBegan) {
  RoomRules rules;
  rules.schedule = Schedule::parse({"daily 08:00-12:00"});
  const SessionStatus status = status_of(60s, 60s);
  EXPECT_EQ(rule_to_end(rules, {status, true, 0h, 1}, at_local(10, 11)), "");
  EXPECT_EQ(rule_to_end(rules, {status, true, 0h, 1}, at_local(10, 12)), "schedule");
  EXPECT_EQ(rule_to_end(rules, {status, false, 0h, 1}, at_local(10, 12)), "") << "a person began it";
}

}  // namespace
}  // namespace kiroku::recorder

#include "fleet/catalogue/room_board.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::fleet {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::IsEmpty;

const UtcTime kNoon = *parse_utc("2026-11-27T12:00:00Z");

ApplianceReport well(const std::string& room, const std::string& state = "recording") {
  ApplianceReport report;
  report.program = "0.1.0";
  report.run = std::string(32, 'a');
  report.now = kNoon;
  report.recorder = ApplianceReport::Recorder{};
  report.recorder->rooms = {{room, state, "20261127T115000Z-3f9c21ab", 600, 3}};
  report.recorder->disk = DiskReport{1U << 30, 2U << 30, 40.0};
  report.recorder->clock = {true, 1000};
  report.has_store = true;
  report.shipping.emplace();
  return report;
}

EnrolledAppliance enrolled(const std::string& name, ApplianceReport report,
                           std::chrono::seconds heard_ago = 2s) {
  if (report.now == kNoon) report.now -= heard_ago;
  EnrolledAppliance one;
  one.name = name;
  one.certificate_until = kNoon + std::chrono::days(60);
  one.heard = kNoon - heard_ago;
  one.report = to_json(report);
  return one;
}

std::vector<Concern> concerns_of(const EnrolledAppliance& one) {
  return board_of({one}, kNoon).at(0).concerns;
}

TEST(RoomBoard, TellsNothingOfARoomThatIsWell) {
  const std::vector<BoardRow> board = board_of({enrolled("or-1", well("or-1"))}, kNoon);
  ASSERT_EQ(board.size(), 1U);
  EXPECT_THAT(board[0].concerns, IsEmpty());
  EXPECT_TRUE(board[0].is_heard);
  EXPECT_EQ(board[0].recording_since, kNoon - 602s);
}

TEST(RoomBoard, ACopyThatTookTheNameIsToldUntilItIsEnrolledAnewWhoeverIsHeard) {
  EnrolledAppliance one = enrolled("or-1", well("or-1"));
  one.doubled = kNoon - 2h;
  EXPECT_THAT(concerns_of(one), IsEmpty()) << "what runs showed is told for an hour";
  one.replaced_shown = kNoon - 72h;
  EXPECT_THAT(concerns_of(one), ElementsAre(Concern::kTwoOfOneName));
  one.heard = kNoon - 1h;
  EXPECT_THAT(concerns_of(one), ElementsAre(Concern::kNotHeard, Concern::kTwoOfOneName));
  one.report = "nonsense";
  EXPECT_THAT(concerns_of(one), ElementsAre(Concern::kNotHeard, Concern::kTwoOfOneName));
  one.heard = {};
  EXPECT_THAT(concerns_of(one), ElementsAre(Concern::kTwoOfOneName, Concern::kNeverHeard));
}

TEST(RoomBoard, WhatWasNotHeardOfIsNotToldAsIfItWereSo) {
  ApplianceReport report = well("or-1");
  report.recorder->rooms[0].silent = {"endoscope"};
  const EnrolledAppliance one = enrolled("or-1", report, 21s);
  const std::vector<BoardRow> board = board_of({one}, kNoon);
  EXPECT_FALSE(board.at(0).is_heard);
  EXPECT_THAT(board[0].concerns, ElementsAre(Concern::kNotHeard));
  EXPECT_TRUE(concerns_of(enrolled("or-1", well("or-1"), 20s)).empty());
  EXPECT_THAT(concerns_of(enrolled("or-1", well("or-1"), -1h)), ElementsAre(Concern::kNotHeard));
}

TEST(RoomBoard, EachTroubleIsTold) {
  const auto of = [](auto change) {
    ApplianceReport report = well("or-1");
    change(report);
    return concerns_of(enrolled("or-1", report));
  };
  using R = ApplianceReport;
  EXPECT_THAT(of([](R& r) { r.recorder.reset(); }), ElementsAre(Concern::kNoRecorder));
  EXPECT_THAT(of([](R& r) { r.recorder->rooms[0].ended_by_error = true; }),
              ElementsAre(Concern::kEndedByError));
  EXPECT_THAT(of([](R& r) { r.recorder->rooms[0].not_resumed = true; }), ElementsAre(Concern::kNotResumed));
  EXPECT_THAT(of([](R& r) { r.recorder->rooms[0].silent = {"room"}; }), ElementsAre(Concern::kSilent));
  EXPECT_THAT(of([](R& r) { r.recorder->rooms[0].lost = 1; }), ElementsAre(Concern::kLost));
  EXPECT_THAT(of([](R& r) { r.recorder->disk->hours_left = 7.9; }), ElementsAre(Concern::kDiskShort));
  EXPECT_THAT(of([](R& r) { r.recorder->disk.reset(); }), ElementsAre(Concern::kDiskUnknown));
  const auto unknown_hours = [&](std::uint64_t free_bytes) {
    return of([&](R& r) {
      r.recorder->disk->hours_left.reset();
      r.recorder->disk->free_bytes = free_bytes;
    });
  };
  EXPECT_THAT(unknown_hours(500'000'000), ElementsAre(Concern::kDiskShort));
  EXPECT_THAT(unknown_hours(4'000'000'000'000), IsEmpty());
  EXPECT_THAT(of([](R& r) { r.recorder->clock.synchronised = false; }), ElementsAre(Concern::kClockFree));
  EXPECT_THAT(of([](R& r) {
                r.recorder->authorities = {{"a", 3}, {"b", 1}};
              }),
              ElementsAre(Concern::kNoAuthority));
  EXPECT_THAT(of([](R& r) { r.recorder->authorities = {{"a", 3}, {"b", 0}}; }), IsEmpty());
  EXPECT_THAT(of([](R& r) {
                r.recorder->authorities = {{"a", 0, 5}, {"b", 0, 5, true}};
              }),
              ElementsAre(Concern::kNotShared));
  EXPECT_THAT(of([](R& r) { r.recorder->is_hardware_silent = true; }), ElementsAre(Concern::kHardwareSilent));
  EXPECT_THAT(of([](R& r) { r.shipping->waiting_s = 601; }), ElementsAre(Concern::kShippingStuck));
  EXPECT_THAT(of([](R& r) { r.shipping.reset(); }), ElementsAre(Concern::kShippingUnknown));
  EXPECT_THAT(of([](R& r) {
                r.has_store = false;
                r.shipping.reset();
              }),
              IsEmpty());
}

TEST(RoomBoard, AClockThatLiesMovesNothingButItsOwnOffset) {
  for (const char* claimed : {"1970-01-01T00:00:00Z", "9999-12-31T23:59:59Z"}) {
    ApplianceReport report = well("or-1");
    report.now = *parse_utc(claimed);
    const BoardRow row = board_of({enrolled("or-1", report)}, kNoon).at(0);
    EXPECT_TRUE(row.is_heard);
    EXPECT_THAT(row.concerns, ElementsAre(Concern::kClockOff));
    EXPECT_EQ(row.recording_since, kNoon - 602s);
  }
}

TEST(RoomBoard, WhatNeedsAPersonIsFirst) {
  ApplianceReport lost = well("or-3"), silent = well("or-4");
  lost.recorder->rooms[0].lost = 5;
  silent.recorder->rooms[0].silent = {"endoscope"};
  EnrolledAppliance never;
  never.name = "or-6";
  never.certificate_until = kNoon + std::chrono::days(60);
  std::vector<std::string> order;
  for (const BoardRow& row :
       board_of({enrolled("or-1", well("or-1", "standby")), enrolled("or-2", well("or-2")),
                 enrolled("or-3", lost), enrolled("or-4", silent), enrolled("or-5", well("or-5"), 1h), never},
                kNoon))
    order.push_back(row.appliance);
  EXPECT_THAT(order, ElementsAre("or-5", "or-4", "or-3", "or-6", "or-2", "or-1"));
}

TEST(RoomBoard, RevokedOnesAreLeftOutAndUnreadableReportsAreTold) {
  EnrolledAppliance revoked = enrolled("or-1", well("or-1")), odd = enrolled("or-2", well("or-2"));
  revoked.revoked = kNoon;
  odd.report = "{}";
  const std::vector<BoardRow> board = board_of({revoked, odd}, kNoon);
  ASSERT_EQ(board.size(), 1U);
  EXPECT_THAT(board[0].concerns, ElementsAre(Concern::kUnreadable));
}

}  // namespace
}  // namespace kiroku::fleet

#include "fleet/reports/appliance_report.h"

#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace kiroku::fleet {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

const UtcTime kNow = *parse_utc("2026-11-27T09:00:00Z");

/// As a recorder answers "status", as far as reports are made of it.
json status() {
  return json::parse(R"({"rooms":[{"room":"or-1","state":"recording","case":"20261127T085000Z-3f9c21ab",
      "elapsed_ns":600000000000,"not_resumed":false,"ended_by_error":false,"missed":1,
      "problem":"HL7 message of patient Yamada Taro refused","procedure":[{"name":"hl7","state":"Yamada Taro"}],
      "streams":[{"name":"endoscope","kind":"video","live":true,"age_ms":40,"dropped":3,"unboxed":false},
                 {"name":"room","kind":"video","live":false,"age_ms":9000,"dropped":0,"unboxed":false},
                 {"name":"vitals","kind":"vitals","live":true,"age_ms":5000,"dropped":0,"unboxed":false}],
      "authorities":[{"name":"one","failures":2,"last_error":"http://user:secret@proxy is away",
                      "last_token":"2026-11-27T08:59:00.000000Z"}]}],
    "disk":{"free_bytes":1000,"total_bytes":2000,"hours_left":4.5},
    "clock":{"synchronised":true,"offset_ns":-5,"error_ns":1500000},"uptime_s":3600})");
}

ApplianceReport whole() {
  ApplianceReport report;
  report.program = "0.1.0";
  report.run = std::string(32, 'a');
  report.number = 7;
  report.now = kNow;
  report.recorder = recorder_report(status(), kNow);
  report.has_store = true;
  report.shipping = {4, 4096, 90, 0, 0};
  return report;
}

TEST(ApplianceReportTest, IsMadeOfWhatTheRecorderSays) {
  const ApplianceReport::Recorder recorder = recorder_report(status(), kNow);
  ASSERT_EQ(recorder.rooms.size(), 1U);
  const RoomReport& room = recorder.rooms.front();
  EXPECT_EQ(room.recording_s, 600);
  EXPECT_THAT(room.silent, ElementsAre("room"));
  EXPECT_EQ(room.lost, 3U);
  EXPECT_TRUE(room.has_problem);
  ASSERT_EQ(recorder.authorities.size(), 1U);
  EXPECT_EQ(recorder.authorities.front().token_s, 60);
}

TEST(ApplianceReportTest, TellsOfASilentSourceOfARoomThatRecordsAhead) {
  json other = status();
  for (const auto& [state, silent] : std::map<std::string, std::size_t>{{"standby", 1}, {"idle", 0}}) {
    other["rooms"][0]["state"] = state;
    EXPECT_EQ(recorder_report(other, kNow).rooms.front().silent.size(), silent) << state;
  }
}

TEST(ApplianceReportTest, ADiskThatCannotBeLookedAtIsToldAsUnknownAndNotAsFull) {
  EXPECT_EQ(recorder_report(status(), kNow).disk->hours_left, 4.5);
  json gone = status();
  gone["disk"] = nullptr;
  ApplianceReport report = whole();
  report.recorder = recorder_report(gone, kNow);
  EXPECT_FALSE(report.recorder->disk);
  const std::string told = to_json(report);
  EXPECT_FALSE(parse_report(told).recorder->disk);
  // Programs of before, on either side.
  json plain = json::parse(told);
  EXPECT_EQ(plain["recorder"]["disk"], json::parse(R"({"free_bytes":0,"total_bytes":0,"hours_left":0})"));
  plain["recorder"]["disk"] = nullptr;
  EXPECT_FALSE(parse_report(plain.dump()).recorder->disk);
  // One that is full is another matter.
  plain["recorder"]["disk"] = {{"free_bytes", 0}, {"total_bytes", 2000}, {"hours_left", 0}};
  ASSERT_TRUE(parse_report(plain.dump()).recorder->disk);
  EXPECT_EQ(parse_report(plain.dump()).recorder->disk->hours_left, 0);
}

TEST(ApplianceReportTest, TellsThatARoomHadToAskForATokenOfItsOwn) {
  json two = status();
  two["rooms"].push_back(two["rooms"][0]);
  two["rooms"][1]["room"] = "or-2";
  EXPECT_FALSE(recorder_report(two, kNow).authorities.front().is_unshared);
  two["rooms"][1]["authorities"][0]["not_shared"] = "cannot reach https://yamada:8444";
  ApplianceReport report = whole();
  report.recorder = recorder_report(two, kNow);
  ASSERT_EQ(report.recorder->authorities.size(), 1U);
  EXPECT_TRUE(report.recorder->authorities.front().is_unshared);
  const std::string told = to_json(report);
  EXPECT_THAT(told, Not(HasSubstr("yamada")));
  EXPECT_TRUE(parse_report(told).recorder->authorities.front().is_unshared);
}

TEST(ApplianceReportTest, OfAnEarlierProgramSaysNothingOfSharing) {
  json report = json::parse(to_json(whole()));
  report["recorder"]["authorities"][0].erase("not_shared");
  EXPECT_FALSE(parse_report(report.dump()).recorder->authorities.front().is_unshared);
}

TEST(ApplianceReportTest, TellsThatTheKeyInHardwareDoesNotSign) {
  json silent = status();
  EXPECT_FALSE(recorder_report(silent, kNow).is_hardware_silent) << "a recorder of before says nothing of it";
  silent["hardware_silent"] = "";
  EXPECT_FALSE(recorder_report(silent, kNow).is_hardware_silent);
  silent["hardware_silent"] = "the TPM of Yamada's room does not answer";
  ApplianceReport report = whole();
  report.recorder = recorder_report(silent, kNow);
  EXPECT_TRUE(report.recorder->is_hardware_silent);
  const std::string told = to_json(report);
  EXPECT_THAT(told, Not(HasSubstr("Yamada")));
  EXPECT_TRUE(parse_report(told).recorder->is_hardware_silent);
  json earlier = json::parse(told);
  earlier["recorder"].erase("hardware_silent");
  EXPECT_FALSE(parse_report(earlier.dump()).recorder->is_hardware_silent);
}

TEST(ApplianceReportTest, HoldsNoFreeTextOfTheRecorder) {
  const std::string told = to_json(whole());
  EXPECT_THAT(told, Not(HasSubstr("Yamada")));
  EXPECT_THAT(told, Not(HasSubstr("secret")));
}

TEST(ApplianceReportTest, IsReadAsItWasWritten) {
  const std::string told = to_json(whole());
  EXPECT_EQ(to_json(parse_report(told)), told);
  ApplianceReport without = whole();
  without.recorder.reset();
  without.shipping.reset();
  EXPECT_EQ(to_json(parse_report(to_json(without))), to_json(without));
}

/// Each changes one thing of a whole report.
struct Wrong {
  const char* what;
  void (*change)(json& report);
};

class HostileReport : public testing::TestWithParam<Wrong> {};

TEST_P(HostileReport, IsRefused) {
  json report = json::parse(to_json(whole()));
  GetParam().change(report);
  EXPECT_THROW(parse_report(report.dump()), UsageError);
}

INSTANTIATE_TEST_SUITE_P(
    Reports, HostileReport,
    testing::Values(
        Wrong{"line", [](json& of) { of["recorder"]["rooms"][0]["room"] = "or-1\nor-2"; }},
        Wrong{"control", [](json& of) { of["recorder"]["rooms"][0]["room"] = "or-1\x1b[2J"; }},
        Wrong{"markup", [](json& of) { of["recorder"]["rooms"][0]["room"] = "<b>or-1</b>"; }},
        Wrong{"direction", [](json& of) { of["recorder"]["rooms"][0]["silent"][0] = "r\u202Eoom"; }},
        Wrong{"state", [](json& of) { of["recorder"]["rooms"][0]["state"] = "Recording"; }},
        Wrong{"case", [](json& of) { of["recorder"]["rooms"][0]["case"] = "../../etc"; }},
        Wrong{"twice", [](json& of) { of["recorder"]["rooms"].push_back(of["recorder"]["rooms"][0]); }},
        Wrong{"many",
              [](json& of) {
                for (int i = 0; i < 100; ++i) {
                  of["recorder"]["rooms"].push_back(of["recorder"]["rooms"][0]);
                  of["recorder"]["rooms"].back()["room"] = "r" + std::to_string(i);
                }
              }},
        Wrong{"negative", [](json& of) { of["recorder"]["rooms"][0]["recording_s"] = -1; }},
        Wrong{"age", [](json& of) { of["recorder"]["rooms"][0]["recording_s"] = 9'000'000'000'000LL; }},
        Wrong{"fraction", [](json& of) { of["number"] = 1.5; }},
        Wrong{"hours", [](json& of) { of["recorder"]["disk"]["hours_left"] = -0.5; }},
        Wrong{"unshared", [](json& of) { of["recorder"]["authorities"][0]["not_shared"] = "away"; }},
        Wrong{"hardware", [](json& of) { of["recorder"]["hardware_silent"] = "away"; }},
        Wrong{"run", [](json& of) { of["run"] = "x"; }},
        Wrong{"program", [](json& of) { of["program"] = "0.1\n"; }},
        Wrong{"now", [](json& of) { of["now"] = "soon"; }},
        Wrong{"later", [](json& of) { of["format"] = 2; }},
        Wrong{"lacking", [](json& of) { of.erase("recorder"); }},
        Wrong{"list", [](json& of) { of = json::array(); }}),
    [](const auto& tested) { return std::string(tested.param.what); });

TEST(ApplianceReportTest, WhatIsTooLargeOrTooDeepIsRefused) {
  EXPECT_THROW(parse_report(std::string(kLargestReport + 1, ' ')), UsageError);
  EXPECT_THROW(parse_report(std::string(1000, '[')), UsageError);
}

TEST(ApplianceReportTest, FieldsOfALaterProgramArePassedOver) {
  json report = json::parse(to_json(whole()));
  report["mood"] = "<script>";
  EXPECT_THAT(to_json(parse_report(report.dump())), Not(HasSubstr("script")));
}

}  // namespace
}  // namespace kiroku::fleet

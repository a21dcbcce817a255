#include "media/vital_line.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace kiroku::media {
namespace {

const UtcTime kNoon = *parse_utc("2026-08-05T12:00:00Z");

struct Example {
  VitalLine line;
  std::string text;
};

std::vector<Example> examples() {
  VitalSample sample{1, {}, "MDC_X", 0, 2.5, 0, {}, "%", "", VitalQuality::kGood};
  return {
      {sample, R"({"time_ns":1,"code":"MDC_X","value":2.5,"unit":"%","source":"","quality":"good"})"},
      {VitalText{2, kNoon, "2267^COMEN_ACVPU^99COMEN", 0, "Alert", "bed 4"},
       R"({"time_ns":2,"kind":"text","device_time":"2026-08-05T12:00:00.000000Z","code":"2267^COMEN_ACVPU^99COMEN","text":"Alert","source":"bed 4"})"},
      {VitalText{2, {}, "MDC_MODE", 65536, "", ""},
       R"({"time_ns":2,"kind":"text","code":"MDC_MODE","mdc":65536,"text":"","source":""})"},
      {VitalText{2, {}, "MDC_MODE", 0, "VF", "m", VitalQuality::kInvalid},
       R"({"time_ns":2,"kind":"text","code":"MDC_MODE","text":"VF","source":"m","quality":"invalid"})"},
      {DeviceAlarm{3, {}, "MDC_EVT_LO", 0, "", "", "", "", "", "m", VitalQuality::kQuestionable},
       R"({"time_ns":3,"kind":"alarm","code":"MDC_EVT_LO","text":"","about":"","phase":"","state":"","priority":"","source":"m","quality":"questionable"})"},
      {DeviceAlarm{3, {}, "MDC_EVT_HI", 196670, "high", "MDC_PULS_RATE", "start", "active", "PH", "m"},
       R"({"time_ns":3,"kind":"alarm","code":"MDC_EVT_HI","mdc":196670,"text":"high","about":"MDC_PULS_RATE","phase":"start","state":"active","priority":"PH","source":"m"})"},
      {DeviceMessage{4, "MSH|^~\\&|\r", "AA", "m"},
       R"({"time_ns":4,"kind":"message","answer":"AA","text":"MSH|^~\\&|\u000d","source":"m"})"},
      {DeviceMessage{4, "\xFF", "AA", "m"},
       R"({"time_ns":4,"kind":"message","answer":"AA","base64":"/w==","source":"m"})"},
      {DeviceClock{5, kNoon, 12, 3, "m"},
       R"({"time_ns":5,"kind":"device-clock","zero":"2026-08-05T12:00:00.000000Z","spread_ns":12,"messages":3,"source":"m"})"},
      {VitalNotice{6, "segment-unknown", "ZDP", "m"},
       R"({"time_ns":6,"kind":"notice","notice":"segment-unknown","text":"ZDP","source":"m"})"}};
}

TEST(VitalLine, WordsAndAlarmsAreOfNoOtherQuality) {
  for (const char* quality : {"good", "missing", "so-so"}) {
    EXPECT_THAT(parse_vital_line_of_any_kind(
                    R"({"time_ns":2,"kind":"text","code":"A","text":"","source":"","quality":")" +
                    std::string(quality) + "\"}")
                    .problem,
                testing::HasSubstr("quality is none of questionable, invalid"))
        << quality;
  }
  EXPECT_THROW(to_json_line(VitalLine(VitalText{1, {}, "A", 0, "x", "", VitalQuality::kMissing})), Error);
}

TEST(VitalLine, HasOneFormOfEachKindAndReadsItBack) {
  for (const Example& example : examples()) {
    EXPECT_EQ(to_json_line(example.line), example.text);
    const VitalLineParse parse = parse_vital_line_of_any_kind(example.text);
    ASSERT_TRUE(parse.line) << parse.problem << " in " << example.text;
    EXPECT_EQ(*parse.line, example.line);
  }
}

TEST(VitalLine, IsReadOnlyForWhatItSays) {
  for (const Example& example : examples()) {
    for (std::size_t i = 0; i < example.text.size(); ++i) {
      EXPECT_FALSE(parse_vital_line_of_any_kind(example.text.substr(0, i)).line);
      for (const char other : {'"', '0', ' ', 'x', '\\', '\n', '}', '\xC3'}) {
        std::string changed = example.text;
        changed[i] = other;
        const VitalLineParse parse = parse_vital_line_of_any_kind(changed);
        if (!parse.line) {
          EXPECT_NE(parse.problem, "") << changed;
          continue;
        }
        EXPECT_TRUE(nlohmann::json::accept(changed)) << changed;
        EXPECT_EQ(parse_vital_line_of_any_kind(to_json_line(*parse.line)).line, parse.line) << changed;
      }
    }
  }
}

TEST(VitalLine, IsReadWhateverTheOrderOfItsKeysAndTheBlanksBetween) {
  std::mt19937_64 random(11);
  for (const Example& example : examples()) {
    const auto written = nlohmann::ordered_json::parse(example.text);
    std::vector<std::pair<std::string, nlohmann::ordered_json>> members;
    for (const auto& [key, value] : written.items()) members.emplace_back(key, value);
    for (int round = 0; round < 50; ++round) {
      std::shuffle(members.begin(), members.end(), random);
      nlohmann::ordered_json other = nlohmann::ordered_json::object();
      for (const auto& [key, value] : members) other[key] = value;
      std::string line = other.dump(1);
      std::ranges::replace(line, '\n', ' ');
      const VitalLineParse parse = parse_vital_line_of_any_kind(line);
      ASSERT_TRUE(parse.line) << parse.problem << " in " << line;
      EXPECT_EQ(*parse.line, example.line) << line;
    }
  }
}

TEST(VitalLine, SaysWhatIsWrong) {
  const auto problem = [](std::string_view line) { return parse_vital_line_of_any_kind(line).problem; };
  EXPECT_EQ(problem(R"({"time_ns":1,"kind":"poem","text":"","source":""})"),
            "the kind 'poem' is none of text, alarm, message, device-clock, notice");
  EXPECT_EQ(problem(R"({"time_ns":1,"kind":"notice","notice":"a","source":""})"),
            "text is missing at column 55");
  EXPECT_EQ(problem(R"({"time_ns":1,"kind":"message","answer":"AA","base64":"*","source":""})"),
            "base64 is not well formed at column 54");
  EXPECT_EQ(problem(R"({"time_ns":1,"kind":"message","answer":"AA","base64":"QQ==","text":"A","source":""})"),
            "a key is none of those that such a line has at column 61");
  EXPECT_EQ(problem(R"({"time_ns":1,"kind":"text","code":"","text":"A","source":""})"),
            "code is empty at column 35");
  EXPECT_EQ(problem(R"({"time_ns":-1,"kind":"notice","notice":"a","text":"","source":""})"),
            "time_ns is not from 0 to 2^53 - 1 at column 12");
}

TEST(VitalLine, WillNotWriteWhatItCouldNotRead) {
  EXPECT_THROW(to_json_line(VitalLine(VitalText{1, {}, "", 0, "x", ""})), Error);
  EXPECT_THROW(to_json_line(VitalLine(VitalText{1, {}, "A", 0, "\xFF", ""})), Error);
  EXPECT_THROW(to_json_line(VitalLine(VitalNotice{-1, "a", "", ""})), Error);
  EXPECT_THROW(to_json_line(VitalLine(DeviceMessage{1, std::string(1U << 20U, 'x'), "AA", ""})), Error);
}

TEST(VitalLine, KeepsALongMessageInBase64WhereItsTextWouldNotFit) {
  const VitalLine line = DeviceMessage{1, std::string(200'000, '\r'), "AA", ""};
  const std::string text = to_json_line(line);
  EXPECT_NE(text.find("\"base64\":\""), std::string::npos);
  EXPECT_EQ(parse_vital_line_of_any_kind(text).line, line);
}

TEST(VitalLine, AWaveformMayMissValuesButNotAll) {
  const double missing = std::numeric_limits<double>::quiet_NaN();
  VitalSample wave{1, {}, "MDC_X", 0, {}, 2, {1, missing, 3}, "mV", "", VitalQuality::kGood};
  const std::string text =
      R"({"time_ns":1,"code":"MDC_X","rate_hz":2,"values":[1,null,3],"unit":"mV","source":"","quality":"good"})";
  EXPECT_EQ(to_json_line(wave), text);
  const VitalParse parse = parse_vital_line(text);
  ASSERT_TRUE(parse.sample) << parse.problem;
  EXPECT_TRUE(std::isnan(parse.sample->values.at(1)));
  EXPECT_EQ(to_json_line(*parse.sample), text);
  wave.values = {missing, missing};
  EXPECT_EQ(problem_of(wave), "a waveform has no value but null");
  EXPECT_EQ(
      parse_vital_line(
          R"({"time_ns":1,"code":"A","rate_hz":2,"values":[nan],"unit":"","source":"","quality":"good"})")
          .problem,
      "values is no number at column 47");
}

}  // namespace
}  // namespace kiroku::media

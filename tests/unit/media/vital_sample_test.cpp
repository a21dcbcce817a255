#include "media/vital_sample.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "media/vital_codes.h"

namespace kiroku::media {
namespace {

VitalSample saturation() {
  VitalSample sample;
  sample.time_ns = 1'500'000'000;
  sample.code = "MDC_PULS_OXIM_SAT_O2";
  sample.mdc = 150456;
  sample.value = 97.5;
  sample.unit = "%";
  sample.source = "synthetic:patient";
  return sample;
}

constexpr std::string_view kSaturationLine =
    R"({"time_ns":1500000000,"code":"MDC_PULS_OXIM_SAT_O2","mdc":150456,"value":97.5,"unit":"%",)"
    R"("source":"synthetic:patient","quality":"good"})";

TEST(VitalSample, WritesItsKeysInOrder) { EXPECT_EQ(to_json_line(saturation()), kSaturationLine); }

TEST(VitalSample, ReadsItsOwnLine) {
  const VitalParse parse = parse_vital_line(kSaturationLine);
  ASSERT_TRUE(parse.sample) << parse.problem;
  EXPECT_EQ(*parse.sample, saturation());
}

TEST(VitalSample, WritesWaveformsDeviceTimesAndMissingValues) {
  VitalSample wave = saturation();
  wave.code = "MDC_ECG_ELEC_POTL_II";
  wave.mdc = 0;
  wave.device_time = parse_utc("2026-08-05T09:15:02.25Z");
  wave.value.reset();
  wave.rate_hz = 250;
  wave.values = {-0.125, 0, 1e-7};
  wave.source = "bed \"4\" \\ \n";
  wave.quality = VitalQuality::kQuestionable;
  EXPECT_EQ(to_json_line(wave),
            R"({"time_ns":1500000000,"device_time":"2026-08-05T09:15:02.250000Z",)"
            R"("code":"MDC_ECG_ELEC_POTL_II","rate_hz":250,"values":[-0.125,0,1e-07],"unit":"%",)"
            R"("source":"bed \"4\" \\ \u000a","quality":"questionable"})");
  EXPECT_EQ(parse_vital_line(to_json_line(wave)).sample, wave);

  VitalSample missing = saturation();
  missing.value.reset();
  missing.quality = VitalQuality::kMissing;
  EXPECT_NE(to_json_line(missing).find(R"("value":null,)"), std::string::npos);
  EXPECT_EQ(parse_vital_line(to_json_line(missing)).sample, missing);
}

TEST(VitalSample, StampsAWaveformWhenItsLastValueIsComplete) {
  VitalSample wave = saturation();
  wave.rate_hz = 250;
  wave.values.assign(250, 0);
  EXPECT_EQ(waveform_time_ns(wave, 0), 500'000'000);
  EXPECT_EQ(waveform_time_ns(wave, 249), 1'496'000'000);
}

/// A double with random bits: every exponent, subnormal numbers too.
double any_finite(std::mt19937_64& random) {
  for (;;) {
    const auto value = std::bit_cast<double>(random());
    if (std::isfinite(value)) {
      return value;
    }
  }
}

std::string any_text(std::mt19937_64& random) {
  static const std::vector<std::string> kPieces = {"a", "\"", "\\",         "\n", "\x01", "é",
                                                   "µ", "日", "\U0001F600", " ",  "{",    "\x7f"};
  std::string text;
  for (std::uint64_t i = random() % 9; i > 0; --i) {
    text += kPieces[random() % kPieces.size()];
  }
  return text;
}

TEST(VitalSample, ReadsBackWhateverItWrites) {
  std::mt19937_64 random(20260805);
  for (int round = 0; round < 2000; ++round) {
    VitalSample sample;
    sample.time_ns = static_cast<std::int64_t>(random() >> 11U);
    if (random() % 3 == 0) {
      sample.device_time = UtcTime(std::chrono::microseconds(random() % 4'000'000'000'000'000));
    }
    sample.code = "C" + any_text(random);
    sample.mdc = static_cast<std::uint32_t>(random() >> (random() % 2 == 0 ? 32U : 63U));
    sample.unit = any_text(random);
    sample.source = any_text(random);
    switch (random() % 3) {
      case 0:
        sample.quality = VitalQuality::kMissing;
        break;
      case 1:
        sample.value = any_finite(random);
        sample.quality = VitalQuality::kInvalid;
        break;
      default:
        sample.rate_hz = 1 + static_cast<double>(random() % 1000);
        for (std::uint64_t i = random() % 60; i <= 60; ++i) {
          sample.values.push_back(any_finite(random));
        }
        sample.rate_hz += 60;
    }
    const std::string line = to_json_line(sample);
    ASSERT_EQ(line.find('\n'), std::string::npos);
    const VitalParse parse = parse_vital_line(line);
    ASSERT_TRUE(parse.sample) << parse.problem << " in " << line;
    ASSERT_EQ(*parse.sample, sample) << line;
  }
}

TEST(VitalSample, RefusesEveryCutLineAndTakesAChangedByteOnlyForWhatItSays) {
  const std::string line(kSaturationLine);
  for (std::size_t length = 0; length < line.size(); ++length) {
    EXPECT_FALSE(parse_vital_line(line.substr(0, length)).sample) << length;
  }
  for (std::size_t i = 0; i < line.size(); ++i) {
    for (int byte = 0; byte < 256; ++byte) {
      std::string changed = line;
      changed[i] = static_cast<char>(byte);
      const VitalParse parse = parse_vital_line(changed);
      if (!parse.sample) {
        EXPECT_NE(parse.problem, "");
        continue;
      }
      // Another reader of JSON sees the same in it as in the one line that would have been written.
      const nlohmann::json seen = nlohmann::json::parse(changed, nullptr, false);
      EXPECT_EQ(seen, nlohmann::json::parse(to_json_line(*parse.sample))) << changed;
    }
  }
}

TEST(VitalSample, IsReadWhateverTheOrderOfItsKeysAndTheBlanksBetween) {
  VitalSample sample = saturation();
  sample.device_time = parse_utc("2026-08-05T09:15:02.5Z");
  VitalSample wave = sample;
  wave.value.reset();
  wave.rate_hz = 2;
  wave.values = {1, -0.5, 1e-7};
  std::mt19937_64 random(7);
  for (const VitalSample& each : {sample, wave}) {
    const auto written = nlohmann::ordered_json::parse(to_json_line(each));
    std::vector<std::pair<std::string, nlohmann::ordered_json>> members;
    for (const auto& [key, value] : written.items()) members.emplace_back(key, value);
    for (int round = 0; round < 50; ++round) {
      std::shuffle(members.begin(), members.end(), random);
      nlohmann::ordered_json other = nlohmann::ordered_json::object();
      for (const auto& [key, value] : members) other[key] = value;
      std::string line = other.dump(2, '\t');
      std::ranges::replace(line, '\n', ' ');
      const VitalParse parse = parse_vital_line(line);
      ASSERT_TRUE(parse.sample) << parse.problem << " in " << line;
      EXPECT_EQ(*parse.sample, each) << line;
    }
  }
}

TEST(VitalSample, IsReadInEveryFormThatNumbersAndTextsHaveInJson) {
  const VitalParse parse = parse_vital_line(
      R"({"quality":"g\u006fod","code":"A\/\"\\\b\f\n\r\t\u00e4\ud83d\ude00","unit":"","source":"","value":-1.50E+2,"time_ns":7})");
  ASSERT_TRUE(parse.sample) << parse.problem;
  EXPECT_EQ(parse.sample->value, -150);
  EXPECT_EQ(parse.sample->time_ns, 7);
  EXPECT_EQ(parse.sample->code, "A/\"\\\b\f\n\r\tä😀");
}

TEST(VitalSample, SaysWhatIsWrongAndWhere) {
  const auto problem = [](std::string_view line) { return parse_vital_line(line).problem; };
  const auto with = [&](std::string_view members) {
    return problem(R"({"unit":"","source":"","quality":"good",)" + std::string(members) + "}");
  };
  EXPECT_EQ(problem(""), "expected { at column 1");
  EXPECT_EQ(problem("[1]"), "expected { at column 1");
  EXPECT_EQ(problem(R"({"time_ns" 1})"), "expected : at column 12");
  EXPECT_EQ(problem(R"({"time_ns":})"), "expected a value at column 12");
  EXPECT_EQ(problem(R"({"time_ns":1;)"), "expected , or } at column 14");
  EXPECT_EQ(problem(R"({"time_ns":1,"time_ns":2})"), "a key stands twice at column 14");
  EXPECT_EQ(problem(R"({"time_ns":1,})"), "expected a key at column 14");
  EXPECT_EQ(problem(R"({"time_ns":"1"})"), "time_ns is no number at column 12");
  EXPECT_EQ(problem(R"({"time_ns":1.5})"), "time_ns is no whole number at column 12");
  EXPECT_EQ(problem(R"({"time_ns":01})"), "time_ns is no number at column 12");
  EXPECT_EQ(problem(R"({"time_ns":99999999999999999999})"), "time_ns is beyond what it may be at column 12");
  EXPECT_EQ(with(R"("time_ns":9007199254740992,"code":"A","value":1)"), "time_ns is not from 0 to 2^53 - 1");
  EXPECT_EQ(with(R"("time_ns":1,"code":"A","value":nan)"), "value is no number at column 72");
  EXPECT_EQ(with(R"("time_ns":1,"code":"A","value":1e999)"), "value is beyond what it may be at column 72");
  EXPECT_EQ(with(R"("time_ns":1,"code":"A","value":null)"),
            "a value must be null if, and only if, its quality is missing");
  EXPECT_EQ(with(R"("time_ns":1,"code":"A","rate_hz":1,"values":[])"), "values is no number at column 86");
  EXPECT_EQ(with(R"("time_ns":1,"code":"A","rate_hz":1)"), "values is missing at column 76");
  EXPECT_EQ(with(R"("time_ns":1,"code":"A","value":1,"rate_hz":1,"values":[1])"),
            "a key is none of those that such a line has at column 64");
  EXPECT_EQ(with(R"("time_ns":1,"code":"A","value":1,"more":[1])"),
            "a key is none of those that such a line has at column 74");
  EXPECT_EQ(with(R"("time_ns":1,"code":"A","value":1,"mdc":0)"),
            "mdc is 0, which stands for unknown and is left out at column 80");
  EXPECT_EQ(with(R"("time_ns":1,"code":"A\x41","value":1)"), "an escape is none of JSON at column 62");
  EXPECT_EQ(with(R"("time_ns":1,"code":"A\ud83d","value":1)"), "an escape is none of JSON at column 62");
  EXPECT_EQ(with("\"time_ns\":1,\"code\":\"A\xC0\x80\",\"value\":1"), "a text is not UTF-8 at column 61");
  EXPECT_EQ(problem(R"({"time_ns":1,"code":"A","value":1,"unit":"","source":"","quality":"fine"})"),
            "quality is none of good, questionable, invalid, missing at column 67");
  EXPECT_EQ(problem(std::string(kSaturationLine) + " x"), "there is more after the object at column 137");
  EXPECT_EQ(problem(std::string(kMaximumVitalLineBytes + 1, '[')), "the line is longer than 1 MiB");
  std::string many = "{";
  for (int i = 0; i < 17; ++i) many += "\"key" + std::to_string(i) + "\":1,";
  EXPECT_EQ(problem(many), "there are more keys than any line has at column 152");
}

TEST(VitalSample, WillNotWriteWhatItCouldNotRead) {
  const auto refused = [](auto change) {
    VitalSample sample = saturation();
    change(sample);
    EXPECT_THROW(to_json_line(sample), Error);
  };
  refused([](VitalSample& s) { s.time_ns = -1; });
  refused([](VitalSample& s) { s.code.clear(); });
  refused([](VitalSample& s) { s.value = std::numeric_limits<double>::infinity(); });
  refused([](VitalSample& s) { s.value.reset(); });
  refused([](VitalSample& s) { s.quality = VitalQuality::kMissing; });
  refused([](VitalSample& s) { s.unit = "\xFF"; });
  refused([](VitalSample& s) { s.values = {1}; });
  refused([](VitalSample& s) {
    s.value.reset();
    s.rate_hz = 1;
    s.values.assign(61, 0);
  });
}

TEST(VitalCodes, AreSortedUniqueAndFoundByName) {
  for (const VitalCode& code : vital_codes()) {
    EXPECT_EQ(find_vital_code(code.code), &code);
    // Partition 2 of IEEE 11073-10101; only the project's own codes are outside the nomenclature.
    EXPECT_EQ(code.mdc >> 16U, code.code.starts_with("MDC_") ? 2U : 0U) << code.code;
  }
  EXPECT_EQ(find_vital_code("MDC_ECG_HEART_RATE")->mdc, 147842U);
  EXPECT_EQ(find_vital_code("MDC_PULS_OXIM_SAT_O2")->unit, "%");
  EXPECT_EQ(find_vital_code("MDC_PULS_OXIM_SAT"), nullptr);
  EXPECT_EQ(find_vital_code(""), nullptr);
}

}  // namespace
}  // namespace kiroku::media

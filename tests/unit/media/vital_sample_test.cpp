#include "media/vital_sample.h"

#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

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

TEST(VitalSample, RefusesEveryCutLineAndEveryLineWithAByteChangedToAnotherForm) {
  const std::string line(kSaturationLine);
  for (std::size_t length = 0; length < line.size(); ++length) {
    EXPECT_FALSE(parse_vital_line(line.substr(0, length)).sample) << length;
  }
  for (std::size_t i = 0; i < line.size(); ++i) {
    for (int byte = 0; byte < 256; ++byte) {
      std::string changed = line;
      changed[i] = static_cast<char>(byte);
      const VitalParse parse = parse_vital_line(changed);
      // What is accepted is one line for one sample: there is no second way to write it.
      if (parse.sample) {
        EXPECT_EQ(to_json_line(*parse.sample), changed);
      } else {
        EXPECT_NE(parse.problem, "");
      }
    }
  }
}

TEST(VitalSample, SaysWhatIsWrongAndWhere) {
  const auto problem = [](std::string_view line) { return parse_vital_line(line).problem; };
  EXPECT_EQ(problem(""), "expected {\"time_ns\": at column 1");
  EXPECT_EQ(problem(R"({"time_ns":1.5,)"), "expected , at column 13");
  EXPECT_EQ(problem(R"({"time_ns":01,)"), "a number is not in its shortest form at column 12");
  EXPECT_EQ(
      problem(R"({"time_ns":9007199254740992,"code":"A","value":1,"unit":"","source":"","quality":"good"})"),
      "time_ns is not from 0 to 2^53 - 1");
  EXPECT_EQ(problem(R"({"time_ns":1,"code":"A","value":nan,"unit":"","source":"","quality":"good"})"),
            "the value is not finite");
  EXPECT_EQ(problem(R"({"time_ns":1,"code":"A","value":1.0,"unit":"","source":"","quality":"good"})"),
            "a number is not in its shortest form at column 33");
  EXPECT_EQ(problem(R"({"time_ns":1,"code":"A","value":1,"unit":"","source":"","quality":"fine"})"),
            "quality is none of good, questionable, invalid, missing at column 73");
  EXPECT_EQ(problem(R"({"time_ns":1,"code":"A","value":null,"unit":"","source":"","quality":"good"})"),
            "a value must be null if, and only if, its quality is missing");
  EXPECT_EQ(
      problem(R"({"time_ns":1,"code":"A","rate_hz":1,"values":[],"unit":"","source":"","quality":"good"})"),
      "expected a number at column 47");
  EXPECT_EQ(problem(R"({"time_ns":1,"code":"A\u0041","value":1,"unit":"","source":"","quality":"good"})"),
            "a character is escaped that need not be at column 23");
  EXPECT_EQ(problem("{\"time_ns\":1,\"code\":\"A\xC0\x80\""), "a text is not UTF-8 at column 25");
  EXPECT_EQ(problem(std::string(kSaturationLine) + " "), "there is more after the object at column 136");
  EXPECT_EQ(problem(std::string(kMaximumVitalLineBytes + 1, '[')), "the line is longer than 1 MiB");
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

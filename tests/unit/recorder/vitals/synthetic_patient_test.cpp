#include "recorder/vitals/synthetic_patient.h"

#include <algorithm>
#include <map>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "media/vital_codes.h"
#include "recorder/clock/case_clock.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/patient_model.h"

namespace kiroku::recorder {
namespace {

std::vector<VitalSample> first_seconds(const std::string& options, std::int64_t seconds) {
  const CaseClock clock;
  const auto source = open_vital_source(parse_source_address("synthetic:patient" + options), clock);
  std::vector<VitalSample> samples;
  for (;;) {
    auto sample = std::get<VitalSample>(*source->next());
    if (sample.time_ns > seconds * 1'000'000'000) {
      return samples;
    }
    samples.push_back(std::move(sample));
  }
}

std::map<std::string, std::vector<double>> by_code(const std::vector<VitalSample>& samples) {
  std::map<std::string, std::vector<double>> values;
  for (const VitalSample& sample : samples) {
    auto& of_code = values[sample.code];
    if (sample.value) {
      of_code.push_back(*sample.value);
    }
    of_code.insert(of_code.end(), sample.values.begin(), sample.values.end());
  }
  return values;
}

TEST(SyntheticPatient, IsTheSameForTheSameSeedAndAnotherForAnother) {
  EXPECT_EQ(first_seconds("?seed=7", 20), first_seconds("?seed=7&speed=max", 20));
  EXPECT_EQ(first_seconds("", 20), first_seconds("?seed=1", 20));
  EXPECT_NE(first_seconds("?seed=7", 20), first_seconds("?seed=8", 20));
}

TEST(SyntheticPatient, GivesTheSameNumbersWithAndWithoutWaveforms) {
  auto with = first_seconds("?seed=2", 30);
  std::erase_if(with, [](const VitalSample& sample) { return sample.is_waveform(); });
  EXPECT_EQ(with, first_seconds("?seed=2&waves=0", 30));
}

TEST(SyntheticPatient, ComesInOrderOfTimeAndAsValidLines) {
  std::int64_t last_ns = 0;
  for (const VitalSample& sample : first_seconds("?flash=1", 30)) {
    EXPECT_GE(sample.time_ns, last_ns);
    last_ns = sample.time_ns;
    const media::VitalParse parse = media::parse_vital_line(to_json_line(sample));
    EXPECT_EQ(parse.sample, sample) << parse.problem;
    const media::VitalCode* code = media::find_vital_code(sample.code);
    ASSERT_NE(code, nullptr) << sample.code;
    EXPECT_EQ(sample.mdc, code->mdc);
    EXPECT_EQ(sample.unit, code->unit);
    EXPECT_EQ(sample.source, "synthetic:patient");
  }
}

TEST(SyntheticPatient, FlashesExactlyAtMultiplesOfTheCaseClock) {
  std::vector<std::int64_t> flashes;
  for (const VitalSample& sample : first_seconds("?flash=3&waves=0", 10)) {
    if (sample.code == media::kFlashCode) {
      EXPECT_EQ(sample.value, 1);
      flashes.push_back(sample.time_ns);
    }
  }
  EXPECT_EQ(flashes, (std::vector<std::int64_t>{0, 3'000'000'000, 6'000'000'000, 9'000'000'000}));
  EXPECT_FALSE(by_code(first_seconds("", 10)).contains(std::string(media::kFlashCode)));
}

TEST(SyntheticPatient, GivesEveryValueOfItsWaveformsOnce) {
  const auto values = by_code(first_seconds("", 60));
  EXPECT_EQ(values.at("MDC_ECG_ELEC_POTL_II").size(), 60U * 250);
  EXPECT_EQ(values.at("MDC_PULS_OXIM_PLETH").size(), 60U * 125);
  EXPECT_EQ(values.at("MDC_ECG_HEART_RATE").size(), 61U);
  EXPECT_EQ(values.at("MDC_TEMP_BODY").size(), 7U);
  EXPECT_EQ(values.at("MDC_PRESS_BLD_NONINV_SYS").size(), 1U);
}

TEST(SyntheticPatient, StaysWithinWhatAnAnaesthetistExpects) {
  const std::map<std::string, std::pair<double, double>> ranges = {{"MDC_ECG_HEART_RATE", {55, 90}},
                                                                   {"MDC_PULS_OXIM_PULS_RATE", {55, 90}},
                                                                   {"MDC_PULS_OXIM_SAT_O2", {95, 100}},
                                                                   {"MDC_PRESS_BLD_ART_ABP_SYS", {90, 140}},
                                                                   {"MDC_PRESS_BLD_ART_ABP_DIA", {55, 90}},
                                                                   {"MDC_PRESS_BLD_ART_ABP_MEAN", {70, 105}},
                                                                   {"MDC_PRESS_BLD_NONINV_SYS", {85, 145}},
                                                                   {"MDC_PRESS_BLD_NONINV_DIA", {50, 95}},
                                                                   {"MDC_PRESS_BLD_NONINV_MEAN", {65, 110}},
                                                                   {"MDC_RESP_RATE", {11, 13}},
                                                                   {"MDC_AWAY_CO2_ET", {32, 40}},
                                                                   {"MDC_TEMP_BODY", {35.9, 36.8}},
                                                                   {"MDC_ECG_ELEC_POTL_II", {-0.7, 1.4}},
                                                                   {"MDC_PULS_OXIM_PLETH", {0, 1}}};
  const auto values = by_code(first_seconds("?seed=11", 1200));
  ASSERT_EQ(values.size(), ranges.size());
  for (const auto& [code, of_code] : values) {
    const auto [least, most] = std::ranges::minmax(of_code);
    EXPECT_GE(least, ranges.at(code).first) << code;
    EXPECT_LE(most, ranges.at(code).second) << code;
  }
}

// The number on the monitor and the R waves of the ECG must be of one heart.
TEST(SyntheticPatient, BeatsInItsEcgAsOftenAsItsHeartRateSays) {
  const auto values = by_code(first_seconds("?seed=5", 120));
  const auto& ecg = values.at("MDC_ECG_ELEC_POTL_II");
  int beats = 0;
  for (std::size_t i = 1; i < ecg.size(); ++i) {
    beats += ecg[i - 1] < 0.5 && ecg[i] >= 0.5 ? 1 : 0;
  }
  double mean_rate = 0;
  for (const double rate : values.at("MDC_ECG_HEART_RATE")) {
    mean_rate += rate / 121;
  }
  EXPECT_NEAR(beats / 2.0, mean_rate, 1.0);
}

TEST(SyntheticPatient, HasSinusArrhythmia) {
  const auto ecg = by_code(first_seconds("?seed=5", 60)).at("MDC_ECG_ELEC_POTL_II");
  std::vector<double> intervals_s;
  double last = -1;
  for (std::size_t i = 1; i < ecg.size(); ++i) {
    if (ecg[i - 1] < 0.5 && ecg[i] >= 0.5) {
      const double now = static_cast<double>(i) / 250;
      if (last >= 0) {
        intervals_s.push_back(now - last);
      }
      last = now;
    }
  }
  const auto [shortest, longest] = std::ranges::minmax(intervals_s);
  EXPECT_GT(longest - shortest, 0.03);
  EXPECT_LT(longest - shortest, 0.25);
}

TEST(SyntheticPatient, RefusesOptionsItDoesNotKnow) {
  for (const char* options : {"?sed=1", "?seed=x", "?seed=-1", "?flash=0.5", "?waves=2", "?speed=2"}) {
    EXPECT_THROW(
        open_vital_source(parse_source_address(std::string("synthetic:patient") + options), CaseClock()),
        UsageError)
        << options;
  }
}

TEST(SyntheticPatient, EndsWhenInterrupted) {
  const CaseClock clock;
  const auto source = open_vital_source(parse_source_address("synthetic:patient"), clock);
  EXPECT_TRUE(source->next());
  source->interrupt();
  EXPECT_FALSE(source->next());
}

TEST(PatientRandom, IsSplitmix64) {
  // First output for seed 0 is e220a8397b1dcdaf (Vigna's reference implementation).
  PatientRandom random(0);
  EXPECT_EQ(random.uniform(), static_cast<double>(0xE220A8397B1DCDAFU >> 11U) * 0x1p-53);
}

TEST(Wander, HasTheDeviationItWasGiven) {
  PatientRandom random(1);
  Wander wander(2, 10);
  double sum = 0, squares = 0;
  constexpr int kSteps = 200'000;
  for (int i = 0; i < kSteps; ++i) {
    const double value = wander.step(5, random);
    sum += value;
    squares += value * value;
  }
  EXPECT_NEAR(sum / kSteps, 0, 0.05);
  EXPECT_NEAR(squares / kSteps, 4, 0.1);
}

}  // namespace
}  // namespace kiroku::recorder

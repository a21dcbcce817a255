#include "trainer/psychophysics/vibration_sense.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

constexpr double kSampleSeconds = 5e-4;

std::vector<double> sinusoid(double amplitude_m, double hz, double seconds) {
  std::vector<double> values;
  // Faded in and out: what begins at once is felt as a step.
  for (double t = 0; t < seconds; t += kSampleSeconds) {
    const double edge = std::min({1.0, 4 * t / seconds, 4 * (seconds - t) / seconds});
    values.push_back(edge * amplitude_m * std::sin(2 * std::numbers::pi * hz * t));
  }
  return values;
}

double db(const TouchCurves& curves, TouchChannel channel, double hz) {
  return 20 * std::log10(felt_amplitude_m(curves, channel, hz) / 1e-6);
}

TEST(VibrationSense, ThresholdsHaveWhatTheSourcesSay) {
  for (const TouchCurves& curves : {TouchCurves{}, TouchCurves{0, 10, 1}, TouchCurves{-30, 2, 10}}) {
    const auto of = [&](TouchChannel channel, double hz) { return db(curves, channel, hz); };
    // P: -12 dB an octave to 220 Hz, then 9 dB.
    EXPECT_NEAR(of(TouchChannel::kPacinian, 220), curves.pacinian_best_db, 1e-9);
    EXPECT_NEAR(of(TouchChannel::kPacinian, 110) - of(TouchChannel::kPacinian, 220), 12, 1e-9);
    EXPECT_NEAR(of(TouchChannel::kPacinian, 440) - of(TouchChannel::kPacinian, 220), 9, 1e-9);
    // P and NP I meet at 40 Hz.
    EXPECT_NEAR(of(TouchChannel::kNp1, 40), of(TouchChannel::kPacinian, 40), 1e-9);
    EXPECT_NEAR(of(TouchChannel::kNp1, 20) - of(TouchChannel::kNp1, 40), curves.np1_slope_db, 1e-9);
    EXPECT_NEAR(of(TouchChannel::kNp1, 400), of(TouchChannel::kNp1, 40), 1e-9);
    // NP I and NP III meet where they are told to, and NP III is as good everywhere.
    EXPECT_NEAR(of(TouchChannel::kNp3, curves.np3_to_hz), of(TouchChannel::kNp1, curves.np3_to_hz), 1e-9);
    EXPECT_NEAR(of(TouchChannel::kNp3, 0), of(TouchChannel::kNp3, 100), 1e-9);
    EXPECT_TRUE(std::isinf(felt_amplitude_m(curves, TouchChannel::kPacinian, 0)));
    EXPECT_TRUE(std::isinf(felt_amplitude_m(curves, TouchChannel::kNp1, 0)));
  }
}

TEST(VibrationSense, RefusesCurvesWithoutSense) {
  for (const TouchCurves& curves : {TouchCurves{std::nan(""), 5, 3}, TouchCurves{-20, -1, 3},
                                    TouchCurves{-20, 5, 0}, TouchCurves{-20, 5, 40}})
    EXPECT_THROW((void)felt_amplitude_m(curves, TouchChannel::kNp1, 10), UsageError);
}

TEST(VibrationSense, AtEachFrequencyTheChannelThatIsKnownForItFeelsFirst) {
  const auto first = [](double hz) {
    TouchChannel found = TouchChannel::kNp3;
    for (const TouchChannel channel : kTouchChannels) {
      if (felt_amplitude_m({}, channel, hz) < felt_amplitude_m({}, found, hz)) found = channel;
    }
    return found;
  };
  EXPECT_EQ(first(1), TouchChannel::kNp3);
  EXPECT_EQ(first(2.9), TouchChannel::kNp3);
  EXPECT_EQ(first(3.1), TouchChannel::kNp1);
  EXPECT_EQ(first(39), TouchChannel::kNp1);
  EXPECT_EQ(first(41), TouchChannel::kPacinian);
  EXPECT_EQ(first(600), TouchChannel::kPacinian);
}

TEST(VibrationSense, ASinusoidOfTheThresholdIsJustFelt) {
  for (const double hz : {1.0, 10.0, 40.0, 250.0}) {
    for (std::size_t c = 0; c < kTouchChannels.size(); ++c) {
      const double amplitude_m = felt_amplitude_m({}, kTouchChannels[c], hz);
      if (std::isinf(amplitude_m)) continue;
      EXPECT_NEAR(felt_by_channels({}, sinusoid(amplitude_m, hz, 12), kSampleSeconds)[c], 1, 0.03)
          << hz << " " << c;
      EXPECT_NEAR(felt_by_channels({}, sinusoid(2 * amplitude_m, hz, 12), kSampleSeconds)[c], 2, 0.06) << hz;
    }
  }
  EXPECT_NEAR(felt_level_db({}, sinusoid(felt_amplitude_m({}, TouchChannel::kPacinian, 250), 250, 12),
                            kSampleSeconds),
              0, 0.3);
}

TEST(VibrationSense, OnlyThePacinianChannelAddsUpOverTime) {
  const double pacinian_m = felt_amplitude_m({}, TouchChannel::kPacinian, 250),
               np1_m = felt_amplitude_m({}, TouchChannel::kNp1, 30);
  const double p_short = felt_by_channels({}, sinusoid(pacinian_m, 250, 0.1), kSampleSeconds)[2],
               p_long = felt_by_channels({}, sinusoid(pacinian_m, 250, 4), kSampleSeconds)[2];
  EXPECT_LT(p_short, 0.4 * p_long);
  const double n_short = felt_by_channels({}, sinusoid(np1_m, 30, 0.4), kSampleSeconds)[1],
               n_long = felt_by_channels({}, sinusoid(np1_m, 30, 4), kSampleSeconds)[1];
  EXPECT_GT(n_short, 0.9 * n_long);
}

TEST(VibrationSense, NothingIsFeltOfRest) {
  EXPECT_TRUE(std::isinf(felt_level_db({}, std::vector<double>(100, 0.0), kSampleSeconds)));
  EXPECT_EQ(felt_by_channels({}, {}, kSampleSeconds)[0], 0);
}

TEST(Fingerpad, StiffensAsItIsPressed) {
  EXPECT_NEAR(fingerpad_stiffness_n_m(0), 190, 1e-9);
  EXPECT_NEAR(fingerpad_stiffness_n_m(1), 2290, 1e-9);
}

}  // namespace
}  // namespace kiroku::trainer

#include "sim/respiration/wave_fit.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

namespace kiroku::sim {
namespace {

struct Series {
  std::vector<double> times_s, moved_m, weights;
};
Series series_of(const GroupMotion& motion, const Waveform& waveform, double wobble_m) {
  Series series;
  for (int i = 0; i < 80; ++i) {
    const double time_s = 0.25 * i;
    series.times_s.push_back(time_s);
    // What no waveform knows, and is not alike from one moment to the next.
    series.moved_m.push_back(motion.moved_m(waveform, time_s) + wobble_m * std::sin(37.0 * i * i));
    series.weights.push_back(1 + (i % 3));
  }
  return series;
}

TEST(WaveFit, ASineIsFoundWithItsCycleBaselineAndDrift) {
  const GroupMotion truth{0.008, 1.1, std::nullopt, -0.003, 0.0001};
  const Series series = series_of(truth, Waveform(SineWave{4.2}), 0.0003);
  const double cycle_s = best_cycle_s(series.times_s, series.moved_m, series.weights, 2.2, 5.8);
  EXPECT_NEAR(cycle_s, 4.2, 0.02);
  const WaveFit fit =
      fit_wave(series.times_s, series.moved_m, series.weights, Waveform(SineWave{cycle_s}), true);
  EXPECT_NEAR(fit.amplitude_m, truth.amplitude_m, 4 * fit.amplitude_error_m);
  EXPECT_NEAR(fit.baseline_m, truth.baseline_m, 4 * fit.baseline_error_m);
  EXPECT_NEAR(fit.drift_m_per_s, truth.drift_m_per_s, 4 * fit.drift_error_m_per_s);
  EXPECT_LT(fit.amplitude_error_m, 0.0001);
  EXPECT_NEAR(fit.left_m, 0.0002, 0.0001);
  EXPECT_GT(fit.explained, 0.99);
}

TEST(WaveFit, ANegativeAmplitudeIsHalfACycleLater) {
  const Waveform sine(SineWave{4});
  const Series series = series_of({-0.005, 0.5, std::nullopt, 0, 0}, sine, 0);
  const WaveFit fit = fit_wave(series.times_s, series.moved_m, series.weights, sine, false);
  EXPECT_NEAR(fit.amplitude_m, 0.005, 1e-6);
  EXPECT_NEAR(fit.phase_s, 2.5, 1e-3);
  EXPECT_EQ(fit.drift_m_per_s, 0);
}

TEST(WaveFit, ATraceIsFollowedWithItsLag) {
  BreathingTrace trace;
  for (int i = 0; i < 500; ++i) {
    trace.times_s.push_back(0.05 * i - 2);
    trace.values.push_back(std::sin(1.7 * trace.times_s.back()) *
                           (1 + 0.3 * std::sin(0.4 * trace.times_s.back())));
  }
  const Waveform waveform(trace);
  const Series series = series_of({0.006, -0.35, std::nullopt, 0.002, 0}, waveform, 0.0001);
  const WaveFit fit = fit_wave(series.times_s, series.moved_m, series.weights, waveform, true);
  EXPECT_NEAR(fit.phase_s, -0.35, 0.02);
  EXPECT_NEAR(fit.amplitude_m, 0.006, 0.0001);
  EXPECT_NEAR(fit.baseline_m, 0.002, 0.0001);
}

TEST(WaveFit, WhatStaysExplainsNothing) {
  const Series series = series_of({0, 0, std::nullopt, 0.002, 0}, Waveform(SineWave{4}), 0.0005);
  const WaveFit fit = fit_wave(series.times_s, series.moved_m, series.weights, Waveform(SineWave{4}), false);
  EXPECT_LT(fit.amplitude_m, 4 * fit.amplitude_error_m);
  EXPECT_LT(fit.explained, 0.2);
}

}  // namespace
}  // namespace kiroku::sim

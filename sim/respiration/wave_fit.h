// How a group's motion over time follows a waveform: amplitude, phase, baseline and drift by least squares.
// Pure, thread-safe.
#pragma once

#include <span>

#include "sim/respiration/breathing.h"

namespace kiroku::sim {

/// What of GroupMotion is estimated from a series of moments.
struct WaveFit {
  double amplitude_m = 0, phase_s = 0, baseline_m = 0, drift_m_per_s = 0;
  /// Standard errors by what is left, where neighbours in time count as one in so far as they are alike.
  double amplitude_error_m = 0, phase_error_s = 0, baseline_error_m = 0, drift_error_m_per_s = 0;
  double left_m = 0;     // standard deviation of what is left
  double explained = 0;  // of the motion's variance, 0 to 1
};

/// `weights` are of each value, positive. Amplitudes are not negative where the waveform repeats; phases are
/// then from 0 to a cycle, else from -2 to 2 s. Without `drift` the baseline stays. Eight moments at least,
/// ascending.
WaveFit fit_wave(std::span<const double> times_s, std::span<const double> moved_m,
                 std::span<const double> weights, const Waveform& waveform, bool drift);

/// The cycle between `from_s` and `to_s` of the sine that is nearest to the values.
double best_cycle_s(std::span<const double> times_s, std::span<const double> moved_m,
                    std::span<const double> weights, double from_s, double to_s);

}  // namespace kiroku::sim

// How a group's motion over time follows a waveform: amplitude, phase, baseline and drift by least squares.
// Pure, thread-safe.
#pragma once

#include <span>

#include "sim/respiration/breathing.h"

namespace kiroku::sim {

/// How long a breath lasts.
struct CycleFit {
  double cycle_s = 0;
  double error_s = 0;  // standard error; 0 where the cycle is given
};

/// What of GroupMotion is estimated from a series of moments.
struct WaveFit {
  double amplitude_m = 0, phase_s = 0, baseline_m = 0, drift_m_per_s = 0;
  /// Standard errors by what is left, where neighbours in time count as one in so far as they are alike, and
  /// by the cycle's own: the phase is that of time 0, so a cycle that is off moves it more the later the
  /// series is.
  double amplitude_error_m = 0, phase_error_s = 0, baseline_error_m = 0, drift_error_m_per_s = 0;
  double phase_per_cycle = 0;  // change of the phase where the cycle is another, s/s; 0 where it is given
  double left_m = 0;           // standard deviation of what is left
  double explained = 0;        // of the motion's variance, 0 to 1
};

/// `weights` are of each value, positive. Amplitudes are not negative where the waveform repeats; phases are
/// then from 0 to a cycle, else from -2 to 2 s. Without `drift` the baseline stays. `cycle_error_s` is of a
/// waveform that repeats, as CycleFit has it. Eight moments at least, ascending.
WaveFit fit_wave(std::span<const double> times_s, std::span<const double> moved_m,
                 std::span<const double> weights, const Waveform& waveform, bool drift,
                 double cycle_error_s = 0);

/// The same motion, its phase so many whole cycles later.
void shift_phase(WaveFit& wave, double cycles, const CycleFit& cycle);

/// The cycle between `from_s` and `to_s` of the sine that, with a drift, is nearest to the values. Eight
/// moments at least, ascending.
CycleFit fit_cycle(std::span<const double> times_s, std::span<const double> moved_m,
                   std::span<const double> weights, double from_s, double to_s);

}  // namespace kiroku::sim

// How likely a hand feels a force that is renewed at some rate as vibrating. Pure, thread-safe.
#pragma once

namespace kiroku::trainer {

/// The probability of the answer "vibrating" to forces at a rate r:
///   lapse / 2 + (1 - lapse) * Phi((log10 threshold - log10 r) / spread)
/// with Phi the cumulative normal distribution. Who lapses guesses. At the threshold half of the answers are
/// "vibrating"; above it forces are taken for continuous.
struct PsychometricFunction {
  double threshold_hz = 1;
  double spread = 0.1;  // of log10 rate: 0.1 is a quarter of the rate
  double lapse_rate = 0;

  [[nodiscard]] double vibrating(double rate_hz) const;
};

}  // namespace kiroku::trainer

#include "trainer/psychophysics/psychometric_function.h"

#include <cmath>
#include <numbers>

namespace kiroku::trainer {

double PsychometricFunction::vibrating(double rate_hz) const {
  const double deviation = std::log10(threshold_hz / rate_hz) / spread;
  return lapse_rate / 2 + (1 - lapse_rate) * std::erfc(-deviation / std::numbers::sqrt2) / 2;
}

}  // namespace kiroku::trainer

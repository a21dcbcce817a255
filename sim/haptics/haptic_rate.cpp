#include "sim/haptics/haptic_rate.h"

#include <string>

#include "base/error.h"

namespace kiroku::sim {

double haptic_rate_hz(std::size_t fingers) {
  if (fingers == 0) return 0;
  for (const HapticRateThreshold& threshold : kHapticRateThresholds) {
    if (threshold.fingers == fingers) return threshold.rate_hz;
  }
  throw UsageError("no haptic rate is known for " + std::to_string(fingers) +
                   " fingers: one to five were studied");
}

}  // namespace kiroku::sim

#include "trainer/psychophysics/rate_series.h"

#include "base/error.h"

namespace kiroku::trainer {

std::size_t nearest_rate(RateSeries series, double hz) {
  std::size_t best = 1;
  for (std::size_t i = 2; i <= rates_of(series); ++i) {
    if (std::abs(std::log(rate_hz(series, i) / hz)) < std::abs(std::log(rate_hz(series, best) / hz)))
      best = i;
  }
  return best;
}

RateSeries rate_series(const std::string& name) {
  for (const RateSeries series : {RateSeries::kHapticRate, RateSeries::kExclusion}) {
    if (name == name_of(series)) return series;
  }
  throw UsageError("'" + name + "' is no series of rates: it must be haptic-rate or exclusion");
}

std::string name_of(RateSeries series) {
  return series == RateSeries::kHapticRate ? "haptic-rate" : "exclusion";
}

}  // namespace kiroku::trainer

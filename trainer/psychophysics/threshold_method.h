// Ways to find a threshold by questions: which rate to give next, and what the answers say.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "trainer/psychophysics/rate_series.h"
#include "trainer/statistics/comparison.h"

namespace kiroku::trainer {

struct ThresholdEstimate {
  double hz = 0;
  Interval interval_hz;  // 95 %
};

/// Not thread-safe.
class ThresholdMethod {
 public:
  virtual ~ThresholdMethod() = default;
  /// What to give next, the i of the series that the method was made for.
  [[nodiscard]] virtual std::size_t next_rate() = 0;
  /// What was said about it.
  virtual void answer(bool vibrating) = 0;
  /// The method's own estimate, by its own rule; absent while it has none. All methods' answers are also
  /// evaluated alike, by a ThresholdPosterior.
  [[nodiscard]] virtual std::optional<double> own_estimate_hz() const = 0;
};

/// "search", "staircase", "bayesian".
enum class MethodKind { kSearch, kStaircase, kBayesian };
MethodKind method_kind(const std::string& name);  // kiroku::UsageError
std::string name_of(MethodKind kind);

/// kSearch: the series of rates, halved at each answer until one i is left (eight answers of the exclusion
///   study's series, ten of the haptic-rate study's), then from the beginning again. Its estimate is the
///   geometric mean of what the searches found.
/// kStaircase: one step up after "vibrating", one down after "continuous" on the logarithm of the rate, the
///   step halved at each turn down to 0.04 (up-down with equal weights, so that it comes to rest where half
///   of the answers are "vibrating": Kaernbach, "Simple adaptive testing with the weighted up-down method",
///   1991). Its estimate is the geometric mean of the turns at the least step, an even number of them.
/// kBayesian: the most telling rate, see ThresholdPosterior, and its estimate.
std::unique_ptr<ThresholdMethod> make_method(MethodKind kind, RateSeries series);

}  // namespace kiroku::trainer

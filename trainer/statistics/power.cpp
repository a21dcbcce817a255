#include "trainer/statistics/power.h"

#include <cmath>

#include <boost/math/distributions/non_central_t.hpp>
#include <boost/math/distributions/students_t.hpp>

#include "base/error.h"
#include "trainer/statistics/comparison.h"

namespace kiroku::trainer {
namespace {

double power_of(double noncentrality, double degrees_of_freedom) {
  namespace math = boost::math;
  const double critical = math::quantile(
      math::complement(math::students_t_distribution<double>(degrees_of_freedom), (1 - kConfidence) / 2));
  const math::non_central_t_distribution<double> found(degrees_of_freedom, std::abs(noncentrality));
  return math::cdf(math::complement(found, critical)) + math::cdf(found, -critical);
}

template <typename Power>
std::size_t least_number(double effect, double power, const Power& of) {
  if (effect == 0 || !std::isfinite(effect))
    throw UsageError("no number of people shows a difference of 0, or one that is no number");
  if (!(power > 1 - kConfidence && power < 1))
    throw UsageError("a power is between 5 %, which chance alone has, and 100 %");
  // The power grows with the number: doubled until it is enough, then halved between.
  std::size_t enough = 2;
  while (of(enough) < power) enough *= 2;
  std::size_t few = enough / 2;
  while (enough - few > 1) {
    const std::size_t middle = (few + enough) / 2;
    (of(middle) < power ? few : enough) = middle;
  }
  return enough;
}

}  // namespace

double power_of_pairs(double effect, std::size_t pairs) {
  if (pairs < 2) return 0;
  const auto count = static_cast<double>(pairs);
  return power_of(effect * std::sqrt(count), count - 1);
}

double power_of_groups(double effect, std::size_t in_each) {
  if (in_each < 2) return 0;
  const auto count = static_cast<double>(in_each);
  return power_of(effect * std::sqrt(count / 2), 2 * count - 2);
}

std::size_t pairs_needed(double effect, double power) {
  return least_number(effect, power, [&](std::size_t pairs) { return power_of_pairs(effect, pairs); });
}

std::size_t in_each_group_needed(double effect, double power) {
  return least_number(effect, power, [&](std::size_t count) { return power_of_groups(effect, count); });
}

}  // namespace kiroku::trainer

#include "trainer/statistics/signed_ranks.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

/// Means of points over readers differ by rounding where they are alike.
constexpr double kAlike = 1e-9;

}  // namespace

SignedRanks signed_ranks(std::span<const double> differences) {
  SignedRanks found;
  found.pairs = differences.size();
  std::vector<double> kept;
  for (const double one : differences) {
    if (!std::isfinite(one)) throw UsageError("a difference is no finite number");
    if (std::abs(one) > kAlike) kept.push_back(one);
  }
  found.differing = kept.size();
  if (kept.empty()) {
    found.why_no_test = differences.empty() ? "there are no pairs" : "no pair differs";
    return found;
  }
  std::ranges::sort(kept, {}, [](double one) { return std::abs(one); });
  // Ranks from 1 on, twice as large, so that means of them are whole.
  std::vector<std::size_t> twice(kept.size());
  for (std::size_t begin = 0, end = 0; begin < kept.size(); begin = end) {
    while (end < kept.size() && std::abs(kept[end]) - std::abs(kept[begin]) <= kAlike) ++end;
    for (std::size_t i = begin; i < end; ++i) twice[i] = begin + 1 + end;
  }
  std::size_t all = 0, positive = 0;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    all += twice[i];
    if (kept[i] > 0) positive += twice[i];
  }
  found.positive = static_cast<double>(positive) / 2;
  // How likely each sum of positive ranks is where each sign is a coin's.
  std::vector<double> chance(all + 1);
  chance[0] = 1;
  std::size_t reached = 0;
  for (const std::size_t rank : twice) {
    reached += rank;
    for (std::size_t sum = reached + 1; sum-- > 0;)
      chance[sum] = (chance[sum] + (sum >= rank ? chance[sum - rank] : 0)) / 2;
  }
  // Twice the distance from the middle, which stays whole.
  const auto distance = [&](std::size_t sum) { return 2 * sum > all ? 2 * sum - all : all - 2 * sum; };
  double p = 0;
  for (std::size_t sum = 0; sum <= all; ++sum) {
    if (distance(sum) >= distance(positive)) p += chance[sum];
  }
  found.p = std::min(1.0, p);
  return found;
}

}  // namespace kiroku::trainer

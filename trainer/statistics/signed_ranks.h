// Wilcoxon's signed-rank test of pairs, exact also where values are alike. Pure, thread-safe.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

namespace kiroku::trainer {

struct SignedRanks {
  std::size_t pairs = 0;      // all that were given
  std::size_t differing = 0;  // those of them whose difference is not zero
  double positive = 0;        // sum of the ranks of positive differences
  std::optional<double> p;    // two-sided
  std::string why_no_test;    // a sentence, where there is none
};

/// Of first - second. Differences of zero are left out, and the mean of their ranks stands for those that are
/// of one size (Wilcoxon, Biometrics Bulletin 1(6), 1945). The p-value is exact: the share of all choices of
/// signs whose rank sum is as far from the middle, counted for the ranks as they are, so that it also holds
/// for few pairs and for points, which are often alike. kiroku::UsageError for what is not finite.
SignedRanks signed_ranks(std::span<const double> differences);

}  // namespace kiroku::trainer

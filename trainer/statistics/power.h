// How likely a study finds a difference that is there, and how many people it takes: Student's t for pairs
// and for two groups of the same size, two-sided at 5 %, by the noncentral t distribution (Cohen,
// "Statistical power analysis for the behavioral sciences", 1988, chapter 2). Pure functions, thread-safe.
#pragma once

#include <cstddef>

namespace kiroku::trainer {

/// With that chance a difference is to be found, as is usual.
inline constexpr double kUsualPower = 0.8;

/// `effect` is the mean of the differences in their standard deviations (Cohen's d_z). Of so many pairs; 0 of
/// fewer than two.
double power_of_pairs(double effect, std::size_t pairs);
/// `effect` is the difference of the means in standard deviations of one group (Cohen's d). Of two groups of
/// so many each; 0 of fewer than two.
double power_of_groups(double effect, std::size_t in_each);

/// The least number with which the power is reached. kiroku::UsageError for an effect of 0, which no number
/// shows, or one that is not finite, and for a power that is not between 5 % and 1.
std::size_t pairs_needed(double effect, double power = kUsualPower);
std::size_t in_each_group_needed(double effect, double power = kUsualPower);

}  // namespace kiroku::trainer

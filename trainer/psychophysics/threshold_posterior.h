// What a row of answers says about a threshold: probabilities of all thresholds, spreads and lapse rates that
// could have given them.
//
// Source: the Bayesian threshold of Watson and Pelli, "QUEST" (1983), with spread and lapse rate unknown too
// as in Watson's QUEST+ (2017); the next rate is the one after whose answer the threshold is expected to be
// known best (least variance of its logarithm: King-Smith et al., 1994).
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "trainer/psychophysics/threshold_method.h"

namespace kiroku::trainer {

/// Between which thresholds are looked for.
inline constexpr double kLeastThresholdHz = 0.4, kMostThresholdHz = 160;

/// Not thread-safe. Before any answer, all thresholds from 0.4 to 160 Hz are equally likely by their
/// logarithm, spreads from 0.03 to 0.27 of it and lapse rates up to 0.1 likewise.
class ThresholdPosterior {
 public:
  explicit ThresholdPosterior(RateSeries series);

  /// `rate` is the i of the series.
  void add(std::size_t rate, bool vibrating);
  /// The mean of the threshold's logarithm, and the 95 % around the middle of its distribution.
  [[nodiscard]] ThresholdEstimate estimate() const;
  /// The rate of the series whose answer would tell most.
  [[nodiscard]] std::size_t most_telling_rate() const;

 private:
  struct Table;
  /// The same for all of a series, made once.
  static const Table& table(RateSeries series);
  const Table* table_;
  Eigen::VectorXd probability_;  // of each threshold, spread and lapse rate
};

}  // namespace kiroku::trainer

#include "sim/respiration/wave_fit.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace kiroku::sim {
namespace {

/// Unknowns in this order, then the phase.
constexpr Eigen::Index kAmplitude = 0, kBaseline = 1, kDrift = 2;
constexpr int kThirds = 40;  // of an interval: a part in ten million is left

class WaveSeries {
 public:
  WaveSeries(std::span<const double> times_s, std::span<const double> moved_m,
             std::span<const double> weights)
      : times_s_(times_s), moved_m_(moved_m), roots_(static_cast<Eigen::Index>(weights.size())) {
    double sum = 0;
    for (const double weight : weights) sum += weight;
    for (Eigen::Index i = 0; i < roots_.size(); ++i) {
      roots_[i] = std::sqrt(weights[static_cast<std::size_t>(i)] / sum * static_cast<double>(weights.size()));
    }
  }

  /// Columns of the linear unknowns, weighted.
  [[nodiscard]] Eigen::MatrixXd columns(const std::function<double(double)>& wave, bool drift) const {
    Eigen::MatrixXd columns(roots_.size(), drift ? 3 : 2);
    for (Eigen::Index i = 0; i < roots_.size(); ++i) {
      const double time_s = times_s_[static_cast<std::size_t>(i)];
      columns(i, kAmplitude) = roots_[i] * wave(time_s);
      columns(i, kBaseline) = roots_[i];
      if (drift) columns(i, kDrift) = roots_[i] * time_s;
    }
    return columns;
  }
  [[nodiscard]] Eigen::VectorXd values() const {
    Eigen::VectorXd values(roots_.size());
    for (Eigen::Index i = 0; i < values.size(); ++i)
      values[i] = roots_[i] * moved_m_[static_cast<std::size_t>(i)];
    return values;
  }
  [[nodiscard]] const Eigen::VectorXd& roots() const { return roots_; }

 private:
  std::span<const double> times_s_, moved_m_;
  Eigen::VectorXd roots_;
};

struct Linear {
  Eigen::VectorXd unknowns;
  double squares = std::numeric_limits<double>::infinity();
};
Linear solved(const Eigen::MatrixXd& columns, const Eigen::VectorXd& values) {
  Linear linear;
  Eigen::MatrixXd normal = columns.transpose() * columns;
  normal.diagonal() *= 1 + 1e-12;
  linear.unknowns = normal.ldlt().solve(columns.transpose() * values);
  linear.squares = (values - columns * linear.unknowns).squaredNorm();
  return linear;
}

/// Between `low` and `high`, where `squares` has one minimum.
double least_between(double low, double high, const std::function<double(double)>& squares) {
  for (int i = 0; i < kThirds; ++i) {
    const double a = low + (high - low) / 3, b = high - (high - low) / 3;
    if (squares(a) < squares(b)) {
      high = b;
    } else {
      low = a;
    }
  }
  return (low + high) / 2;
}

/// Variance of a value, where neighbours in time that are alike tell less.
double variance_of(const Eigen::VectorXd& left, Eigen::Index unknowns) {
  const double squares = left.squaredNorm();
  const double next = left.head(left.size() - 1).dot(left.tail(left.size() - 1));
  const double alike = squares > 0 ? std::clamp(next / squares, 0.0, 0.95) : 0;
  return squares / std::max(static_cast<double>(left.size() - unknowns), 1.0) * (1 + alike) / (1 - alike);
}

Eigen::MatrixXd inverse_of_normal(const Eigen::MatrixXd& slope) {
  Eigen::MatrixXd normal = slope.transpose() * slope;
  // Each unknown by its own measure: the drift's column may be a million times that of a small motion's
  // phase. The second summand keeps a column of zeros (the phase of what does not move) from being singular.
  normal.diagonal() *= 1 + 1e-12;
  normal.diagonal().array() += 1e-30 * normal.diagonal().maxCoeff();
  return normal.inverse();
}

}  // namespace

CycleFit fit_cycle(std::span<const double> times_s, std::span<const double> moved_m,
                   std::span<const double> weights, double from_s, double to_s) {
  const WaveSeries series(times_s, moved_m, weights);
  const Eigen::VectorXd values = series.values();
  // Sine, baseline, drift, cosine.
  const auto columns_at = [&](double rate_hz) {
    const double turns = 2 * std::numbers::pi * rate_hz;
    Eigen::MatrixXd columns(values.size(), 4);
    columns.leftCols(3) = series.columns([&](double time_s) { return std::sin(turns * time_s); }, true);
    columns.col(3) = series.columns([&](double time_s) { return std::cos(turns * time_s); }, false).col(0);
    return columns;
  };
  const auto squares_at = [&](double rate_hz) { return solved(columns_at(rate_hz), values).squares; };
  // A grid, then thirds of the interval around its best. From one step to the next the sine turns by no more
  // than an eighth from the first moment to the last, so that the minimum is not stepped over.
  const double span_s = times_s.back() - times_s.front(), lowest_hz = 1 / to_s, highest_hz = 1 / from_s;
  constexpr double kOfTurn = 0.125, kFewestSteps = 64;
  const double steps = std::max(std::ceil((highest_hz - lowest_hz) * span_s / kOfTurn), kFewestSteps);
  const double step_hz = (highest_hz - lowest_hz) / steps;
  double best_hz = lowest_hz, least = std::numeric_limits<double>::infinity();
  for (double i = 0; i <= steps; ++i) {
    const double tried_hz = lowest_hz + i * step_hz, squares = squares_at(tried_hz);
    if (!(squares < least)) continue;
    least = squares;
    best_hz = tried_hz;
  }
  best_hz = least_between(std::max(best_hz - step_hz, lowest_hz), std::min(best_hz + step_hz, highest_hz),
                          squares_at);

  const Eigen::MatrixXd columns = columns_at(best_hz);
  const Eigen::VectorXd unknowns = solved(columns, values).unknowns;
  Eigen::MatrixXd slope(values.size(), 5);
  slope.leftCols(4) = columns;
  slope.col(4) = series
                     .columns(
                         [&](double time_s) {
                           const double turned = 2 * std::numbers::pi * best_hz * time_s;
                           return -2 * std::numbers::pi * best_hz * best_hz * time_s *
                                  (unknowns[0] * std::cos(turned) - unknowns[3] * std::sin(turned));
                         },
                         false)
                     .col(0);
  const double variance = variance_of(values - columns * unknowns, slope.cols());
  return {1 / best_hz, std::sqrt(std::max(variance * inverse_of_normal(slope)(4, 4), 0.0))};
}

WaveFit fit_wave(std::span<const double> times_s, std::span<const double> moved_m,
                 std::span<const double> weights, const Waveform& waveform, bool drift,
                 double cycle_error_s) {
  const WaveSeries series(times_s, moved_m, weights);
  const Eigen::VectorXd values = series.values();
  constexpr double kMostLagS = 2;
  const bool periodic = waveform.periodic();
  const double from_s = periodic ? 0 : -kMostLagS, span_s = periodic ? waveform.duration_s() : 2 * kMostLagS;
  const auto at_phase = [&](double phase_s) {
    return series.columns([&](double time_s) { return waveform.at(time_s + phase_s); }, drift);
  };
  const auto squares_at = [&](double phase_s) { return solved(at_phase(phase_s), values).squares; };
  // A grid, then thirds of the interval around its best.
  constexpr int kSteps = 80;
  double phase_s = from_s, least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kSteps; ++i) {
    const double tried_s = from_s + span_s * i / kSteps, squares = squares_at(tried_s);
    if (!(squares < least)) continue;
    least = squares;
    phase_s = tried_s;
  }
  phase_s = least_between(phase_s - span_s / kSteps, phase_s + span_s / kSteps, squares_at);
  if (periodic) {
    if (solved(at_phase(phase_s), values).unknowns[kAmplitude] < 0) phase_s += span_s / 2;
    phase_s -= span_s * std::floor(phase_s / span_s);
  }
  const Eigen::MatrixXd columns = at_phase(phase_s);
  const Linear linear = solved(columns, values);

  WaveFit fit;
  fit.amplitude_m = linear.unknowns[kAmplitude];
  fit.baseline_m = linear.unknowns[kBaseline];
  if (drift) fit.drift_m_per_s = linear.unknowns[kDrift];
  fit.phase_s = phase_s;
  const Eigen::VectorXd left = values - columns * linear.unknowns;
  const auto count = static_cast<double>(values.size());
  const double mean = values.dot(series.roots()) / series.roots().squaredNorm();
  const double squares = (values - mean * series.roots()).squaredNorm();
  fit.left_m = std::sqrt(left.squaredNorm() / count);
  fit.explained = squares > 0 ? std::max(1 - left.squaredNorm() / squares, 0.0) : 0;
  const Eigen::Index phase = columns.cols();
  Eigen::MatrixXd slope(values.size(), phase + 1);
  slope.leftCols(phase) = columns;
  constexpr double kStepS = 0.01;
  slope.col(phase) = fit.amplitude_m *
                     (at_phase(phase_s + kStepS).col(0) - at_phase(phase_s - kStepS).col(0)) / (2 * kStepS);
  const Eigen::MatrixXd inverse = inverse_of_normal(slope);
  Eigen::MatrixXd covariance = variance_of(left, slope.cols()) * inverse;
  if (periodic && cycle_error_s > 0) {
    // A wave of time / T changes with T as it does with time, times -time / T. With another cycle the
    // unknowns are others by `per_cycle`; that error is none of these values' own, as the cycle was fitted to
    // what is at right angles to all of these columns.
    Eigen::VectorXd by_cycle = slope.col(phase);
    for (Eigen::Index i = 0; i < by_cycle.size(); ++i)
      by_cycle[i] *= -(times_s[static_cast<std::size_t>(i)] + phase_s) / waveform.duration_s();
    const Eigen::VectorXd per_cycle = -inverse * (slope.transpose() * by_cycle);
    covariance += cycle_error_s * cycle_error_s * per_cycle * per_cycle.transpose();
    fit.phase_per_cycle = per_cycle[phase];
  }
  const auto error = [&](Eigen::Index i) { return std::sqrt(std::max(covariance(i, i), 0.0)); };
  fit.amplitude_error_m = error(kAmplitude);
  fit.baseline_error_m = error(kBaseline);
  if (drift) fit.drift_error_m_per_s = error(kDrift);
  fit.phase_error_s = error(phase);
  return fit;
}

void shift_phase(WaveFit& wave, double cycles, const CycleFit& cycle) {
  const double before = wave.phase_per_cycle * cycle.error_s;
  wave.phase_s += cycles * cycle.cycle_s;
  wave.phase_per_cycle += cycles;
  const double after = wave.phase_per_cycle * cycle.error_s;
  wave.phase_error_s =
      std::sqrt(std::max(wave.phase_error_s * wave.phase_error_s - before * before, 0.0) + after * after);
}

}  // namespace kiroku::sim

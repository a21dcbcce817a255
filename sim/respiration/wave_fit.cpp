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

/// Unknowns in this order.
constexpr Eigen::Index kAmplitude = 0, kBaseline = 1, kDrift = 2, kPhase = 3;

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

}  // namespace

double best_cycle_s(std::span<const double> times_s, std::span<const double> moved_m,
                    std::span<const double> weights, double from_s, double to_s) {
  const WaveSeries series(times_s, moved_m, weights);
  const Eigen::VectorXd values = series.values();
  double best_s = from_s, least = std::numeric_limits<double>::infinity();
  constexpr double kFiner = 1.002;
  for (double cycle_s = from_s; cycle_s <= to_s; cycle_s *= kFiner) {
    const double turns = 2 * std::numbers::pi / cycle_s;
    Eigen::MatrixXd columns(values.size(), 4);
    columns.leftCols(3) = series.columns([&](double time_s) { return std::sin(turns * time_s); }, true);
    columns.col(3) = series.columns([&](double time_s) { return std::cos(turns * time_s); }, false).col(0);
    const double squares = solved(columns, values).squares;
    if (!(squares < least)) continue;
    least = squares;
    best_s = cycle_s;
  }
  return best_s;
}

WaveFit fit_wave(std::span<const double> times_s, std::span<const double> moved_m,
                 std::span<const double> weights, const Waveform& waveform, bool drift) {
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
  double low_s = phase_s - span_s / kSteps, high_s = phase_s + span_s / kSteps;
  for (int i = 0; i < 30; ++i) {
    const double a = low_s + (high_s - low_s) / 3, b = high_s - (high_s - low_s) / 3;
    if (squares_at(a) < squares_at(b)) {
      high_s = b;
    } else {
      low_s = a;
    }
  }
  phase_s = (low_s + high_s) / 2;
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
  // Standard errors: neighbours in time that are alike tell less.
  const double next = left.head(left.size() - 1).dot(left.tail(left.size() - 1));
  const double alike = left.squaredNorm() > 0 ? std::clamp(next / left.squaredNorm(), 0.0, 0.95) : 0;
  Eigen::MatrixXd slope(values.size(), columns.cols() + 1);
  slope.leftCols(columns.cols()) = columns;
  constexpr double kStepS = 0.01;
  slope.rightCols(1) = fit.amplitude_m *
                       (at_phase(phase_s + kStepS).col(0) - at_phase(phase_s - kStepS).col(0)) / (2 * kStepS);
  Eigen::MatrixXd normal = slope.transpose() * slope;
  normal.diagonal().array() += 1e-12 * normal.diagonal().maxCoeff();
  const double variance = left.squaredNorm() / std::max(count - static_cast<double>(slope.cols()), 1.0) *
                          (1 + alike) / (1 - alike);
  const Eigen::MatrixXd covariance = variance * normal.inverse();
  const auto error = [&](Eigen::Index i) { return std::sqrt(std::max(covariance(i, i), 0.0)); };
  fit.amplitude_error_m = error(kAmplitude);
  fit.baseline_error_m = error(kBaseline);
  if (drift) fit.drift_error_m_per_s = error(kDrift);
  fit.phase_error_s = error(drift ? kPhase : kPhase - 1);
  if (periodic) {
    if (fit.amplitude_m < 0) {
      fit.amplitude_m = -fit.amplitude_m;
      fit.phase_s += waveform.duration_s() / 2;
    }
    fit.phase_s -= waveform.duration_s() * std::floor(fit.phase_s / waveform.duration_s());
  }
  return fit;
}

}  // namespace kiroku::sim

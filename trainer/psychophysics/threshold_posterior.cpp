#include "trainer/psychophysics/threshold_posterior.h"

#include <array>
#include <cmath>

#include "trainer/psychophysics/psychometric_function.h"
#include "trainer/psychophysics/rate_series.h"

namespace kiroku::trainer {
namespace {

constexpr std::size_t kThresholds = 241;
constexpr double kLeastLog = -0.4, kGreatestLog = 2.2;  // kLeastThresholdHz, kMostThresholdHz, nearly
constexpr std::array<double, 6> kSpreads{0.03, 0.05, 0.08, 0.12, 0.18, 0.27};
constexpr std::array<double, 4> kLapses{0, 0.02, 0.05, 0.1};
constexpr std::size_t kShapes = kSpreads.size() * kLapses.size();
/// Rates closer than this, as logarithms, are not told apart when the next one is chosen.
constexpr double kLeastStep = 0.02;
/// Thresholds at either end that have less probability than this together do not count when the next rate is
/// chosen.
constexpr double kNegligible = 1e-9;

double log_threshold(std::size_t at) {
  return kLeastLog + (kGreatestLog - kLeastLog) * static_cast<double>(at) / double{kThresholds - 1};
}

/// (thresholds), summed over what the shape may be, of probabilities of states: (shapes x thresholds), column
/// by column.
Eigen::RowVectorXd marginal(const Eigen::VectorXd& probability) {
  return Eigen::Map<const Eigen::MatrixXd>(probability.data(), kShapes, kThresholds).colwise().sum();
}

}  // namespace

struct ThresholdPosterior::Table {
  explicit Table(RateSeries series) {
    vibrating.resize(kThresholds * kShapes, static_cast<Eigen::Index>(rates_of(series)));
    log_hz.resize(kThresholds * kShapes);
    Eigen::Index state = 0;
    for (std::size_t at = 0; at < kThresholds; ++at) {
      for (const double spread : kSpreads) {
        for (const double lapse : kLapses) {
          const PsychometricFunction function{std::pow(10, log_threshold(at)), spread, lapse};
          for (std::size_t i = 1; i <= rates_of(series); ++i)
            vibrating(state, static_cast<Eigen::Index>(i - 1)) = function.vibrating(rate_hz(series, i));
          log_hz[state++] = log_threshold(at);
        }
      }
    }
    for (std::size_t i = 1; i <= rates_of(series); ++i) {
      if (candidates.empty() ||
          std::log10(rate_hz(series, candidates.back()) / rate_hz(series, i)) >= kLeastStep)
        candidates.push_back(i);
    }
    of_candidates.resize(vibrating.rows(), static_cast<Eigen::Index>(candidates.size()));
    for (std::size_t c = 0; c < candidates.size(); ++c) {
      of_candidates.col(static_cast<Eigen::Index>(c)) =
          vibrating.col(static_cast<Eigen::Index>(candidates[c] - 1));
    }
  }

  Eigen::MatrixXd vibrating;  // (states x rates), its column 0 that of i = 1
  std::vector<std::size_t> candidates;
  Eigen::MatrixXd of_candidates;  // (states x candidates)
  Eigen::VectorXd log_hz;         // (states)
};

const ThresholdPosterior::Table& ThresholdPosterior::table(RateSeries series) {
  if (series == RateSeries::kExclusion) {
    static const Table kTable(RateSeries::kExclusion);
    return kTable;
  }
  static const Table kTable(RateSeries::kHapticRate);
  return kTable;
}

ThresholdPosterior::ThresholdPosterior(RateSeries series)
    : table_(&table(series)),
      probability_(Eigen::VectorXd::Constant(table_->log_hz.size(), 1.0 / double(kThresholds * kShapes))) {}

void ThresholdPosterior::add(std::size_t rate, bool vibrating) {
  const auto said = table_->vibrating.col(static_cast<Eigen::Index>(rate - 1)).array();
  if (vibrating) {
    probability_.array() *= said;
  } else {
    probability_.array() *= 1 - said;
  }
  probability_ /= probability_.sum();
}

ThresholdEstimate ThresholdPosterior::estimate() const {
  const Eigen::RowVectorXd of_threshold = marginal(probability_);
  constexpr double kTail = (1 - kConfidence) / 2;
  const auto quantile = [&](double share) {
    double below = 0;
    for (std::size_t at = 0; at < kThresholds; ++at) {
      const double here = of_threshold[static_cast<Eigen::Index>(at)];
      if (below + here >= share) {
        // Each threshold stands for the range halfway to its neighbours.
        const double within = here > 0 ? (share - below) / here - 0.5 : 0;
        return log_threshold(at) + within * (log_threshold(1) - log_threshold(0));
      }
      below += here;
    }
    return kGreatestLog;
  };
  return {std::pow(10, probability_.dot(table_->log_hz)),
          {std::pow(10, quantile(kTail)), std::pow(10, quantile(1 - kTail))}};
}

std::size_t ThresholdPosterior::most_telling_rate() const {
  const Table& all = *table_;
  const Eigen::RowVectorXd of_threshold = marginal(probability_);
  Eigen::Index first = 0, last = of_threshold.size() - 1;
  for (double below = of_threshold[first]; below < kNegligible && first < last; below += of_threshold[first])
    ++first;
  for (double above = of_threshold[last]; above < kNegligible && first < last; above += of_threshold[last])
    --last;
  const Eigen::Index begin = first * Eigen::Index{kShapes},
                     states = (last - first + 1) * Eigen::Index{kShapes};
  const auto log_hz = all.log_hz.segment(begin, states);
  Eigen::MatrixXd moments(states, 3);
  moments.col(0) = probability_.segment(begin, states);
  moments.col(1) = moments.col(0).cwiseProduct(log_hz);
  moments.col(2) = moments.col(1).cwiseProduct(log_hz);
  const Eigen::MatrixXd yes = all.of_candidates.middleRows(begin, states).transpose() * moments;
  const Eigen::RowVector3d total = moments.colwise().sum();
  Eigen::Index best = 0;
  double least = 0;
  for (Eigen::Index c = 0; c < yes.rows(); ++c) {
    // The probability of an answer times the variance that it leaves.
    const auto left = [](const Eigen::RowVector3d& m) { return m[0] > 0 ? m[2] - m[1] * m[1] / m[0] : 0; };
    const double expected = left(yes.row(c)) + left(total - yes.row(c));
    if (c == 0 || expected < least) {
      least = expected;
      best = c;
    }
  }
  return all.candidates[static_cast<std::size_t>(best)];
}

}  // namespace kiroku::trainer

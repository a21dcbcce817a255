#include "trainer/statistics/agreement.h"

#include <algorithm>
#include <cmath>

#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

constexpr double kAgreementTail = (1 - kConfidence) / 2;
/// Sums of shares are as exact as this.
constexpr double kRounding = 1e-12;

/// A square of numbers by two answers.
class Square {
 public:
  explicit Square(int side) : side_(static_cast<std::size_t>(side)), values_(side_ * side_, 0.0) {}
  [[nodiscard]] std::size_t side() const { return side_; }
  double& at(std::size_t row, std::size_t column) { return values_[row * side_ + column]; }
  [[nodiscard]] double at(std::size_t row, std::size_t column) const { return values_[row * side_ + column]; }

 private:
  std::size_t side_;
  std::vector<double> values_;
};

/// How much each pair of answers counts as agreement, from 0 to 1.
Square agreement_of(int points, AgreementWeights weights) {
  if (points < 2) throw UsageError("agreement needs at least two points to choose from");
  Square square(points);
  for (std::size_t row = 0; row < square.side(); ++row) {
    for (std::size_t column = 0; column < square.side(); ++column) {
      const double distance = std::abs(static_cast<double>(row) - static_cast<double>(column)) / (points - 1);
      switch (weights) {
        case AgreementWeights::kNone:
          square.at(row, column) = row == column ? 1 : 0;
          break;
        case AgreementWeights::kLinear:
          square.at(row, column) = 1 - distance;
          break;
        case AgreementWeights::kQuadratic:
          square.at(row, column) = 1 - distance * distance;
          break;
      }
    }
  }
  return square;
}

std::size_t checked(int answer, int points) {
  if (answer < 0 || answer >= points)
    throw UsageError("an answer is " + std::to_string(answer) + ", outside of its " + std::to_string(points) +
                     " points");
  return static_cast<std::size_t>(answer);
}

/// `reach` is zero but for rounding where the standard error is.
std::optional<Interval> around(double value, double reach) {
  constexpr double kNone = 1e-6;
  if (reach < kNone) return std::nullopt;
  return Interval{std::max(-1.0, value - reach), std::min(1.0, value + reach)};
}

constexpr const char* kOneAlone = "one thing alone tells no agreement";
constexpr const char* kAllAlike =
    "all answers are the same, so that nothing tells agreement from a habit: kappa is not defined";

}  // namespace

Agreement cohens_kappa(std::span<const std::pair<int, int>> answers, int points, AgreementWeights weights) {
  const Square weight = agreement_of(points, weights);
  const std::size_t side = weight.side();
  Square share(points);
  Agreement found;
  found.count = answers.size();
  if (answers.empty()) {
    found.why_no_kappa = "nothing was judged by both";
    return found;
  }
  const auto count = static_cast<double>(answers.size());
  for (const auto& [first, second] : answers)
    share.at(checked(first, points), checked(second, points)) += 1 / count;
  std::vector<double> of_first(side), of_second(side);
  for (std::size_t i = 0; i < side; ++i) {
    for (std::size_t j = 0; j < side; ++j) {
      of_first[i] += share.at(i, j);
      of_second[j] += share.at(i, j);
    }
  }
  // Mean weights of a row and of a column, by what the other one answers.
  std::vector<double> mean_row(side), mean_column(side);
  for (std::size_t i = 0; i < side; ++i) {
    for (std::size_t j = 0; j < side; ++j) {
      found.observed += weight.at(i, j) * share.at(i, j);
      found.by_chance += weight.at(i, j) * of_first[i] * of_second[j];
      mean_row[i] += weight.at(i, j) * of_second[j];
      mean_column[j] += weight.at(i, j) * of_first[i];
    }
  }
  if (answers.size() < 2) {
    found.why_no_kappa = kOneAlone;
    return found;
  }
  const double po = found.observed, pe = found.by_chance;
  if (1 - pe < kRounding) {
    found.why_no_kappa = kAllAlike;
    return found;
  }
  double sum = 0;
  for (std::size_t i = 0; i < side; ++i) {
    for (std::size_t j = 0; j < side; ++j) {
      const double term = weight.at(i, j) * (1 - pe) - (mean_row[i] + mean_column[j]) * (1 - po);
      sum += share.at(i, j) * term * term;
    }
  }
  const double mean = po * pe - 2 * pe + po;
  const double variance = std::max(0.0, sum - mean * mean) / (count * std::pow(1 - pe, 4));
  Kappa kappa;
  kappa.value = (po - pe) / (1 - pe);
  kappa.standard_error = std::sqrt(variance);
  const boost::math::normal_distribution<double> normal;
  kappa.interval =
      around(kappa.value,
             boost::math::quantile(boost::math::complement(normal, kAgreementTail)) * kappa.standard_error);
  found.kappa = kappa;
  return found;
}

Agreement fleiss_kappa(std::span<const std::vector<int>> answers, int points, AgreementWeights weights) {
  const Square weight = agreement_of(points, weights);
  const std::size_t side = weight.side();
  // Of each thing that was judged at all, how often each answer was given.
  std::vector<std::vector<double>> given;
  for (const std::vector<int>& of_thing : answers) {
    if (of_thing.empty()) continue;
    std::vector<double>& counts = given.emplace_back(side);
    for (const int answer : of_thing) ++counts[checked(answer, points)];
  }
  const auto total = [](const std::vector<double>& counts) {
    double sum = 0;
    for (const double one : counts) sum += one;
    return sum;
  };
  Agreement found;
  std::vector<double> usual(side);  // share of each answer in all
  for (const auto& counts : given) {
    for (std::size_t k = 0; k < side; ++k)
      usual[k] += counts[k] / total(counts) / static_cast<double>(given.size());
    if (total(counts) >= 2) ++found.count;
  }
  if (found.count == 0) {
    found.why_no_kappa = "nothing was judged by two";
    return found;
  }
  const auto things = static_cast<double>(given.size()), judged_twice = static_cast<double>(found.count);
  std::vector<double> mean_weight(side);
  for (std::size_t k = 0; k < side; ++k) {
    for (std::size_t l = 0; l < side; ++l) {
      found.by_chance += weight.at(k, l) * usual[k] * usual[l];
      mean_weight[k] += weight.at(k, l) * usual[l];
    }
  }
  std::vector<double> agreed(given.size());
  for (std::size_t i = 0; i < given.size(); ++i) {
    const double readers = total(given[i]);
    if (readers < 2) continue;
    double pairs = 0;
    for (std::size_t k = 0; k < side; ++k) {
      double like = 0;
      for (std::size_t l = 0; l < side; ++l) like += weight.at(k, l) * given[i][l];
      pairs += given[i][k] * (like - 1);
    }
    agreed[i] = pairs / (readers * (readers - 1));
    found.observed += agreed[i] / judged_twice;
  }
  const double pe = found.by_chance;
  if (1 - pe < kRounding) {
    found.why_no_kappa = kAllAlike;
    return found;
  }
  Kappa kappa;
  kappa.value = (found.observed - pe) / (1 - pe);
  if (given.size() < 2) {
    found.why_no_kappa = kOneAlone;
    return found;
  }
  double squares = 0;
  for (std::size_t i = 0; i < given.size(); ++i) {
    const double readers = total(given[i]);
    double expected = 0;
    for (std::size_t k = 0; k < side; ++k) expected += given[i][k] * mean_weight[k] / readers;
    const double own = readers < 2 ? 0 : things / judged_twice * (agreed[i] - pe) / (1 - pe);
    const double linear = own - 2 * (1 - kappa.value) * (expected - pe) / (1 - pe);
    squares += (linear - kappa.value) * (linear - kappa.value);
  }
  kappa.standard_error = std::sqrt(squares / (things * (things - 1)));
  const boost::math::students_t_distribution<double> student(things - 1);
  kappa.interval =
      around(kappa.value,
             boost::math::quantile(boost::math::complement(student, kAgreementTail)) * kappa.standard_error);
  found.kappa = kappa;
  return found;
}

}  // namespace kiroku::trainer

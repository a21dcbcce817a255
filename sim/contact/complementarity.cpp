#include "sim/contact/complementarity.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "base/error.h"

namespace kiroku::sim {
namespace {

/// Forces and gaps this much beyond zero, relative to the largest, are rounding: a row is not turned for it.
constexpr double kRounding = 1e-13, kMostRounding = 1e-8;
constexpr std::size_t kMostSteps = 100;
/// So often in a row may a step of many rows fail to leave fewer wrong than ever before; as in the source.
constexpr int kMostFruitless = 3;

}  // namespace

void ComplementarityProblem::reserve(std::size_t rows) {
  if (rows <= gap_.size()) return;
  matrix_.resize(rows * rows);
  reduced_.resize(rows * rows);
  for (std::vector<double>* vector : {&gap_, &force_, &right_, &w_}) vector->resize(rows);
  equality_.resize(rows);
  wrong_.resize(rows);
  pressing_.resize(rows);
  index_.reserve(rows);
}

void ComplementarityProblem::resize(std::size_t rows) {
  // In steps, so that one contact more from time to time does not allocate every time.
  if (rows > gap_.size()) reserve(std::max(rows, 2 * gap_.size()));
  rows_ = rows;
}

Eigen::Map<Eigen::MatrixXd> ComplementarityProblem::matrix() {
  return {matrix_.data(), static_cast<Eigen::Index>(rows_), static_cast<Eigen::Index>(rows_)};
}
Eigen::Map<Eigen::VectorXd> ComplementarityProblem::gap() {
  return {gap_.data(), static_cast<Eigen::Index>(rows_)};
}
Eigen::Map<const Eigen::VectorXd> ComplementarityProblem::force() const {
  return {force_.data(), static_cast<Eigen::Index>(rows_)};
}

void ComplementarityProblem::solve_pressing() {
  index_.clear();
  for (std::size_t row = 0; row < rows_; ++row) {
    if (pressing_[row] != 0) index_.push_back(static_cast<Eigen::Index>(row));
  }
  const auto count = static_cast<Eigen::Index>(index_.size());
  const auto full = matrix();
  Eigen::Map<Eigen::MatrixXd> reduced(reduced_.data(), count, count);
  Eigen::Map<Eigen::VectorXd> right(right_.data(), count), force(force_.data(), full.rows());
  for (Eigen::Index j = 0; j < count; ++j) {
    const auto column = full.col(index_[static_cast<std::size_t>(j)]);
    for (Eigen::Index i = j; i < count; ++i) reduced(i, j) = column[index_[static_cast<std::size_t>(i)]];
    reduced(j, j) += skin_;
    right[j] = -gap_[static_cast<std::size_t>(index_[static_cast<std::size_t>(j)])];
  }
  Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(reduced);
  if (factor.info() != Eigen::Success) {
    throw Error("the compliance between " + std::to_string(count) +
                " contacts is not positive definite: the body's stiffness is not sound");
  }
  factor.solveInPlace(right);
  force.setZero();
  for (Eigen::Index i = 0; i < count; ++i) force[index_[static_cast<std::size_t>(i)]] = right[i];
  // w, by the lower triangle alone.
  Eigen::Map<Eigen::VectorXd> w(w_.data(), full.rows());
  w = gap() + skin_ * force;
  w.noalias() += full.selfadjointView<Eigen::Lower>() * force;
}

std::size_t ComplementarityProblem::count_wrong(double rounding) {
  const double force_bound_n = rounding * force().cwiseAbs().maxCoeff();
  const double gap_bound_m = rounding * gap().cwiseAbs().maxCoeff();
  std::size_t count = 0;
  for (std::size_t row = 0; row < rows_; ++row) {
    wrong_[row] =
        equality_[row] == 0 && (pressing_[row] != 0 ? force_[row] < -force_bound_n : w_[row] < -gap_bound_m);
    count += wrong_[row];
  }
  return count;
}

void ComplementarityProblem::solve() {
  largest_violation_ = 0;
  worst_row_ = 0;
  if (rows_ == 0) return;
  if (!matrix().allFinite() || !gap().allFinite())
    throw Error("a gap or a compliance between contacts is not a finite number: a tool's pose is unsound");
  skin_ = kSkin * matrix().diagonal().maxCoeff();
  for (std::size_t row = 0; row < rows_; ++row) {
    if (equality_[row] != 0) pressing_[row] = 1;
  }
  // Many rows at a time as long as that helps, then one by one (the last that is wrong) until fewer than ever
  // are wrong: a way that visits no state twice, and there are finitely many. Rounding may still make it go
  // round between states that differ by no more than that; then more is taken for rounding.
  std::size_t fewest = std::numeric_limits<std::size_t>::max(), steps = 0;
  int fruitless = 0;
  double rounding = kRounding;
  while (true) {
    solve_pressing();
    const std::size_t wrong = count_wrong(rounding);
    if (wrong == 0) break;
    if (wrong < fewest) {
      fewest = wrong;
      fruitless = 0;
    } else {
      ++fruitless;
    }
    if (++steps > kMostSteps + 4 * rows_) {
      steps = 0;
      rounding *= 10;
      if (rounding > kMostRounding) {
        throw Error("the state of " + std::to_string(rows_) +
                    " contacts cannot be found: their compliance is too badly conditioned");
      }
    }
    const bool one_by_one = fruitless >= kMostFruitless;
    for (std::size_t row = rows_; row-- > 0;) {
      if (wrong_[row] == 0) continue;
      pressing_[row] ^= 1U;
      if (one_by_one) break;
    }
  }
  Eigen::Map<Eigen::VectorXd> answer(force_.data(), static_cast<Eigen::Index>(rows_));
  for (std::size_t row = 0; row < rows_; ++row) {
    if (equality_[row] == 0) answer[static_cast<Eigen::Index>(row)] = std::max(force_[row], 0.0);
    const double w = w_[row] - skin_ * force_[row], violation = equality_[row] != 0 ? std::abs(w) : -w;
    if (violation <= largest_violation_) continue;
    largest_violation_ = violation;
    worst_row_ = row;
  }
}

}  // namespace kiroku::sim

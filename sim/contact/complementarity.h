// Linear complementarity problems of contact: which contacts press, and how hard, in one problem for all
// fingers, pressed and pressing, instead of trying the 3^n states of n fingers.
//
// Find f with w = A f + b, where for every row either w = 0 (an equality row: what sticks), or
// f >= 0, w >= 0, f w = 0 (a row that can only press: force f, gap w). A is symmetric and positive
// semidefinite: the compliance between the contacts.
//
// Source: block principal pivoting with Murty's least-index rule where it does not get on (Judice and Pires,
// "A block principal pivoting algorithm for large-scale strictly monotone linear complementarity problems",
// Computers & Operations Research 21, 1994). Exact, and finite for positive definite A.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace kiroku::sim {

/// Keeps its memory from one problem to the next and allocates only for more rows than ever before. Not
/// thread-safe.
class ComplementarityProblem {
 public:
  /// Room for so many rows.
  void reserve(std::size_t rows);
  /// Sets how many rows the next problem has. What matrix() and the others showed before is lost.
  void resize(std::size_t rows);
  [[nodiscard]] std::size_t rows() const { return rows_; }

  /// To be filled before solve(); (rows x rows), its lower triangle is read, and (rows).
  [[nodiscard]] Eigen::Map<Eigen::MatrixXd> matrix();
  [[nodiscard]] Eigen::Map<Eigen::VectorXd> gap();
  /// 1 for equality rows; (rows).
  [[nodiscard]] std::span<std::uint8_t> equality() { return std::span(equality_).first(rows_); }
  /// Where to begin, and after solve() the answer: 1 for rows that press, and for equality rows; (rows). The
  /// answer does not depend on where it begins, but its last bits may.
  [[nodiscard]] std::span<std::uint8_t> pressing() { return std::span(pressing_).first(rows_); }
  /// The answer f; (rows).
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> force() const;

  /// A grows by kSkin of its largest diagonal entry on the diagonal, so that contacts that say the same (two
  /// fingers on one node, nodes at one place) share the force evenly instead of having no answer of their
  /// own. What that changes of w is kSkin of an indentation, unless the rows contradict each other: then
  /// forces are huge, and largest_violation() tells. kiroku::Error if A is not positive semidefinite, a
  /// number is not finite, or rounding leaves no answer.
  void solve();
  static constexpr double kSkin = 1e-12;

  /// How far w is below zero (or from it, in equality rows) without the skin.
  [[nodiscard]] double largest_violation() const { return largest_violation_; }
  /// The row it is of.
  [[nodiscard]] std::size_t worst_row() const { return worst_row_; }

 private:
  void solve_pressing();
  [[nodiscard]] std::size_t count_wrong(double rounding);

  std::size_t rows_ = 0, worst_row_ = 0;
  double skin_ = 0, largest_violation_ = 0;
  std::vector<double> matrix_, gap_, force_, reduced_, right_, w_;
  std::vector<std::uint8_t> equality_, pressing_, wrong_;
  std::vector<Eigen::Index> index_;  // of the rows that press
};

}  // namespace kiroku::sim

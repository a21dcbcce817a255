// The Cholesky factor of a dense matrix whose last rows come and go.
//
// Source: bordering (Golub and Van Loan, "Matrix Computations", on updating factorisations): rows that are
// appended leave the factor of those before them as it is.
#pragma once

#include <Eigen/Core>

namespace kiroku::sim {

/// Of a symmetric positive definite A (n x n), at first 0 x 0. Not thread-safe while it is changed.
class GrowingCholesky {
 public:
  [[nodiscard]] Eigen::Index rows() const { return lower_.rows(); }

  /// The last k rows of A as it is to be, (k x (n + k)); of its last k columns the lower triangle is read.
  /// False, and A as before, if A would not be positive definite: a pivot is not above kSmallestPivot of its
  /// diagonal entry, so that more than some 1e-6 of an answer would be rounding, or something is not finite.
  [[nodiscard]] bool append(const Eigen::MatrixXd& last_rows);
  static constexpr double kSmallestPivot = 1e-10;

  /// Leaves the first `rows` rows and columns.
  void truncate(Eigen::Index rows);

  /// A^-1 right; (n x m).
  [[nodiscard]] Eigen::MatrixXd solve(Eigen::MatrixXd right) const;
  /// L^-1 right, where L L^T = A.
  [[nodiscard]] Eigen::MatrixXd solve_lower(Eigen::MatrixXd right) const;

 private:
  Eigen::MatrixXd lower_;  // what is above its diagonal is not read
};

}  // namespace kiroku::sim

#include "sim/manipulation/growing_cholesky.h"

#include <utility>

#include <Eigen/Cholesky>

namespace kiroku::sim {

bool GrowingCholesky::append(const Eigen::MatrixXd& last_rows) {
  const Eigen::Index before = rows(), added = last_rows.rows();
  if (added == 0) return true;
  const Eigen::MatrixXd below = solve_lower(last_rows.leftCols(before).transpose()).transpose();
  Eigen::MatrixXd corner = last_rows.rightCols(added);
  const Eigen::VectorXd diagonal = corner.diagonal();
  // Eigen 3.4 divides by the number of columns here.
  if (before > 0) corner.selfadjointView<Eigen::Lower>().rankUpdate(below, -1);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(corner);
  // Pivots are squares of the factor's diagonal. Written so that what is no number fails too.
  if (factor.info() != Eigen::Success ||
      !(corner.diagonal().array().square() > kSmallestPivot * diagonal.array()).all() || !below.allFinite()) {
    return false;
  }
  lower_.conservativeResize(before + added, before + added);
  lower_.bottomLeftCorner(added, before) = below;
  lower_.bottomRightCorner(added, added) = corner;
  return true;
}

void GrowingCholesky::truncate(Eigen::Index rows) { lower_.conservativeResize(rows, rows); }

Eigen::MatrixXd GrowingCholesky::solve_lower(Eigen::MatrixXd right) const {
  if (rows() > 0) lower_.triangularView<Eigen::Lower>().solveInPlace(right);
  return right;
}

Eigen::MatrixXd GrowingCholesky::solve(Eigen::MatrixXd right) const {
  right = solve_lower(std::move(right));
  if (rows() > 0) lower_.transpose().triangularView<Eigen::Upper>().solveInPlace(right);
  return right;
}

}  // namespace kiroku::sim

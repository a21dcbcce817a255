#include "sim/manipulation/growing_cholesky.h"

#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace kiroku::sim {
namespace {

Eigen::MatrixXd random_matrix(Eigen::Index rows, Eigen::Index columns, std::mt19937& random) {
  std::uniform_real_distribution<double> number(-1, 1);
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return number(random); });
}

Eigen::MatrixXd random_definite(Eigen::Index rows, std::mt19937& random) {
  const Eigen::MatrixXd root = random_matrix(rows, rows, random);
  return root * root.transpose() + Eigen::MatrixXd::Identity(rows, rows);
}

void expect_inverse_of(const GrowingCholesky& factor, const Eigen::MatrixXd& matrix) {
  ASSERT_EQ(factor.rows(), matrix.rows());
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(matrix.rows(), matrix.rows());
  EXPECT_LE((matrix * factor.solve(identity) - identity).norm(), 1e-12);
  const Eigen::MatrixXd lower = factor.solve_lower(identity);
  EXPECT_LE((lower.transpose() * lower * matrix - identity).norm(), 1e-12);
}

TEST(GrowingCholesky, SolvesWhileRowsComeAndGo) {
  std::mt19937 random(1);
  const Eigen::MatrixXd matrix = random_definite(40, random);
  GrowingCholesky factor;
  EXPECT_EQ(factor.solve(Eigen::MatrixXd(0, 2)).cols(), 2);
  Eigen::Index rows = 0;
  for (const Eigen::Index added : {1, 7, 20, 12}) {
    Eigen::MatrixXd last_rows = matrix.block(rows, 0, added, rows + added);
    // What is above the diagonal is not read.
    last_rows.rightCols(added).triangularView<Eigen::StrictlyUpper>().setConstant(
        std::numeric_limits<double>::quiet_NaN());
    ASSERT_TRUE(factor.append(last_rows));
    rows += added;
    expect_inverse_of(factor, matrix.topLeftCorner(rows, rows));
  }
  factor.truncate(11);
  expect_inverse_of(factor, matrix.topLeftCorner(11, 11));
  ASSERT_TRUE(factor.append(matrix.block(11, 0, 29, 40)));
  expect_inverse_of(factor, matrix);
  factor.truncate(0);
  EXPECT_EQ(factor.rows(), 0);
}

TEST(GrowingCholesky, BeginsWithAnyNumberOfRows) {
  std::mt19937 random(3);
  const Eigen::MatrixXd matrix = random_definite(150, random);
  for (const Eigen::Index rows : {0, 1, 48, 49, 150}) {
    GrowingCholesky factor;
    ASSERT_TRUE(factor.append(matrix.topLeftCorner(rows, rows)));
    expect_inverse_of(factor, matrix.topLeftCorner(rows, rows));
  }
}

TEST(GrowingCholesky, RefusesWhatIsNotPositiveDefiniteAndStays) {
  std::mt19937 random(2);
  const Eigen::MatrixXd matrix = random_definite(6, random);
  GrowingCholesky factor;
  ASSERT_TRUE(factor.append(matrix));
  Eigen::MatrixXd again(1, 7);  // the fourth row once more
  again << matrix.row(3), matrix(3, 3);
  EXPECT_FALSE(factor.append(again));
  Eigen::MatrixXd indefinite(1, 7);
  indefinite << Eigen::RowVectorXd::Zero(6), -1;
  EXPECT_FALSE(factor.append(indefinite));
  for (const Eigen::Index at : {2, 6}) {
    Eigen::MatrixXd none = Eigen::MatrixXd::Ones(1, 7);
    none(0, at) = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(factor.append(none));
  }
  expect_inverse_of(factor, matrix);
}

}  // namespace
}  // namespace kiroku::sim

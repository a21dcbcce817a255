#include "sim/contact/complementarity.h"

#include <random>

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

void set(ComplementarityProblem& problem, const Eigen::MatrixXd& matrix, const Eigen::VectorXd& gap) {
  problem.resize(static_cast<std::size_t>(gap.size()));
  problem.matrix() = matrix;
  problem.gap() = gap;
  std::ranges::fill(problem.equality(), 0);
  std::ranges::fill(problem.pressing(), 0);
}

struct RandomProblem {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd gap;
};
RandomProblem random_problem(std::mt19937& random, Eigen::Index size) {
  const auto number = [&] { return static_cast<double>(random()) / 4294967296.0 - 0.5; };
  const Eigen::MatrixXd square = Eigen::MatrixXd::NullaryExpr(size, size, number);
  return {square * square.transpose() + 0.05 * Eigen::MatrixXd::Identity(size, size),
          Eigen::VectorXd::NullaryExpr(size, number)};
}

/// Tries every state; there is one answer for a positive definite matrix.
Eigen::VectorXd by_enumeration(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& gap, unsigned equal) {
  const auto size = static_cast<unsigned>(gap.size());
  Eigen::VectorXd answer;
  int answers = 0;
  for (unsigned state = 0; state < 1U << size; ++state) {
    if ((state & equal) != equal) continue;
    std::vector<Eigen::Index> rows;
    for (unsigned row = 0; row < size; ++row)
      if ((state >> row & 1U) != 0) rows.push_back(row);
    Eigen::VectorXd force = Eigen::VectorXd::Zero(gap.size());
    const Eigen::MatrixXd reduced = matrix(rows, rows);
    const Eigen::VectorXd right = -gap(rows), solution = reduced.partialPivLu().solve(right);
    force(rows) = solution;
    const Eigen::VectorXd w = matrix * force + gap;
    bool possible = true;
    for (unsigned row = 0; row < size; ++row) {
      if ((equal >> row & 1U) == 0) possible &= (state >> row & 1U) != 0 ? force[row] >= 0 : w[row] >= -1e-14;
    }
    if (!possible) continue;
    answer = force;
    ++answers;
  }
  EXPECT_EQ(answers, 1);
  return answer;
}

TEST(Complementarity, AnswersAsAllStatesTriedDo) {
  std::mt19937 random(11);
  ComplementarityProblem problem;
  for (int i = 0; i < 1000; ++i) {
    const RandomProblem drawn = random_problem(random, 1 + i % 8);
    // Some of the rows are equalities in every third problem.
    const unsigned equal = i % 3 == 0 ? static_cast<unsigned>(random()) & 0x5U : 0U;
    set(problem, drawn.matrix, drawn.gap);
    for (std::size_t row = 0; row < problem.rows(); ++row) problem.equality()[row] = equal >> row & 1U;
    problem.solve();
    const Eigen::VectorXd expected =
        by_enumeration(drawn.matrix, drawn.gap, equal & ((1U << problem.rows()) - 1));
    EXPECT_LE((problem.force() - expected).norm(), 1e-9 * std::max(expected.norm(), 1e-3)) << i;
    EXPECT_LE(problem.largest_violation(), 1e-10);
  }
}

TEST(Complementarity, TheAnswerDoesNotDependOnWhereItBegins) {
  std::mt19937 random(5);
  ComplementarityProblem problem;
  for (int i = 0; i < 50; ++i) {
    const RandomProblem drawn = random_problem(random, 40);
    set(problem, drawn.matrix, drawn.gap);
    problem.solve();
    const Eigen::VectorXd first = problem.force();
    EXPECT_GE(first.minCoeff(), 0);
    EXPECT_GE((drawn.matrix * first + drawn.gap).minCoeff(), -1e-9);
    for (std::uint8_t& row : problem.pressing()) row = random() & 1U;
    problem.solve();
    EXPECT_LE((problem.force() - first).norm(), 1e-8 * first.norm());
  }
}

TEST(Complementarity, RowsThatSayTheSameShareTheForce) {
  ComplementarityProblem problem;
  set(problem, Eigen::MatrixXd::Constant(3, 3, 2e-3), Eigen::VectorXd::Constant(3, -0.01));
  problem.solve();
  for (Eigen::Index row = 0; row < 3; ++row) EXPECT_NEAR(problem.force()[row], 5.0 / 3, 0.01);
  EXPECT_NEAR(problem.force().sum(), 5, 1e-9);
  EXPECT_LE(problem.largest_violation(), 1e-12);
}

TEST(Complementarity, TellsOfRowsThatContradictEachOther) {
  Eigen::Matrix2d matrix;
  matrix << 1, -1, -1, 1;
  ComplementarityProblem problem;
  set(problem, matrix, Eigen::Vector2d(-0.1, -0.2));
  problem.solve();
  EXPECT_GE(problem.largest_violation(), 0.1);
}

TEST(Complementarity, NothingTouchesAndNothingIsAsked) {
  ComplementarityProblem problem;
  problem.resize(0);
  problem.solve();
  set(problem, Eigen::MatrixXd::Identity(2, 2), Eigen::Vector2d(0.1, 0));
  problem.solve();
  EXPECT_EQ(problem.force(), Eigen::Vector2d::Zero());
}

TEST(Complementarity, RefusesWhatIsNoCompliance) {
  ComplementarityProblem problem;
  Eigen::Matrix2d matrix;
  matrix << 1, 3, 3, 1;
  set(problem, matrix, Eigen::Vector2d(-1, -1));
  std::ranges::fill(problem.pressing(), 1);
  EXPECT_THROW(problem.solve(), Error);
  set(problem, Eigen::Matrix2d::Identity(), Eigen::Vector2d(std::nan(""), -1));
  EXPECT_THROW(problem.solve(), Error);
}

}  // namespace
}  // namespace kiroku::sim

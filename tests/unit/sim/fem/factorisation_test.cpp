#include "sim/fem/factorisation.h"

#include <numeric>

#include <Eigen/Cholesky>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/fem/elimination_order.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

class FactorisationTest : public testing::Test {
 protected:
  explicit FactorisationTest(TetMesh mesh = test::tet_grid({7, 6, 5}, {0.1, 0.08, 0.09}))
      : mesh_(std::move(mesh)) {
    // Single components are held here and there, so that nodes have one, two or three unknowns, or none.
    for (std::size_t number = 0; number < free_.size(); ++number)
      free_[number] = number > 11 && number % 7 != 0;
    for (Eigen::Index i = 0; i < force_n_.size(); ++i) force_n_[i] = static_cast<double>((i * 37) % 101) - 50;
  }
  [[nodiscard]] StiffnessMatrix stiffness_of(const Material& material) const {
    const std::vector<const Material*> materials(mesh_.tetrahedra.size(), &material);
    return {mesh_, materials};
  }

  void expect_the_solution_of_a_dense_one() const;
  void expect_the_same_bits_whatever_the_number_of_threads() const;

  TetMesh mesh_;
  std::vector<std::uint32_t> order_ = elimination_order(mesh_);
  Eigen::Index size_ = static_cast<Eigen::Index>(3 * mesh_.nodes.size());
  std::vector<bool> free_ = std::vector<bool>(static_cast<std::size_t>(size_));
  Eigen::VectorXd force_n_ = Eigen::VectorXd(size_);
};

/// Node after node, which makes fronts so wide that they are worked on in several panels and tiles.
class WideFrontsTest : public FactorisationTest {
 protected:
  WideFrontsTest() : FactorisationTest(test::tet_grid({11, 11, 5}, {0.1, 0.08, 0.09})) {
    std::iota(order_.begin(), order_.end(), 0U);
  }
};

void FactorisationTest::expect_the_solution_of_a_dense_one() const {
  const StiffnessMatrix stiffness = stiffness_of({1e4, 0.4});
  Eigen::MatrixXd dense(size_, size_);
  for (Eigen::Index i = 0; i < size_; ++i) dense.col(i) = stiffness * Eigen::VectorXd::Unit(size_, i);
  EXPECT_LE((dense - dense.transpose()).norm(), 1e-14 * dense.norm());
  Eigen::VectorXd right = force_n_;
  for (Eigen::Index i = 0; i < size_; ++i) {
    if (free_[static_cast<std::size_t>(i)]) continue;
    dense.row(i).setZero();
    dense.col(i).setZero();
    dense(i, i) = 1;
    right[i] = 0;
  }
  const Eigen::VectorXd expected_m = dense.llt().solve(right);
  const Factorisation factorisation(stiffness, free_, order_);
  EXPECT_EQ(factorisation.unknowns(), static_cast<std::size_t>(std::ranges::count(free_, true)));
  const double error = (factorisation.solve(force_n_) - expected_m).norm() / expected_m.norm();
  EXPECT_LE(error, 1e-11);
  RecordProperty("displacement", std::to_string(error * 1e15) + "e-15");
}

void FactorisationTest::expect_the_same_bits_whatever_the_number_of_threads() const {
  const StiffnessMatrix stiffness = stiffness_of({1e4, 0.4});
  const Eigen::VectorXd alone_m = Factorisation(stiffness, free_, order_, 1).solve(force_n_);
  for (const unsigned threads : {2U, 3U, 8U}) {
    for (int repetition = 0; repetition < 5; ++repetition) {
      EXPECT_EQ(Factorisation(stiffness, free_, order_, threads).solve(force_n_), alone_m) << threads;
    }
  }
}

TEST_F(FactorisationTest, SolvesAsADenseOneDoes) { expect_the_solution_of_a_dense_one(); }
TEST_F(WideFrontsTest, SolvesAsADenseOneDoes) { expect_the_solution_of_a_dense_one(); }

TEST_F(FactorisationTest, GivesTheSameBitsWhateverTheNumberOfThreads) {
  expect_the_same_bits_whatever_the_number_of_threads();
}
TEST_F(WideFrontsTest, GivesTheSameBitsWhateverTheNumberOfThreads) {
  expect_the_same_bits_whatever_the_number_of_threads();
}

TEST_F(FactorisationTest, NamesANodeWhereTheMatrixIsNotPositiveDefinite) {
  const StiffnessMatrix stiffness = stiffness_of({-1e4, 0.4});
  std::string first;
  for (const unsigned threads : {1U, 4U}) {
    try {
      const Factorisation factorisation(stiffness, free_, order_, threads);
      FAIL();
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), testing::MatchesRegex("node [0-9]+ can move without any resistance: .*"));
      if (first.empty()) first = error.what();
      EXPECT_EQ(error.what(), first);
    }
  }
}

}  // namespace
}  // namespace kiroku::sim

// Large rotations: the laws that linear elements break, and those that both keep.
#include <random>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/fem/corotational_body.h"
#include "sim/mesh/degrees_of_freedom.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using test::tet_grid;
using testing::HasSubstr;

void record(const char* what, double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2g", value);
  testing::Test::RecordProperty(what, text);
}

double volume_m3(const TetMesh& mesh, const Eigen::VectorXd& displacement_m) {
  TetMesh moved = mesh;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node)
    moved.nodes[node] += displacement_m.segment<3>(first_row(node));
  double sum = 0;
  for (std::size_t t = 0; t < moved.tetrahedra.size(); ++t) sum += signed_volume_m3(moved, t);
  return sum;
}

double uniform(std::mt19937& random) { return static_cast<double>(random()) / 4294967296.0 * 2 - 1; }

Eigen::Matrix3d random_matrix(std::mt19937& random) {
  Eigen::Matrix3d matrix;
  for (double& number : matrix.reshaped()) number = uniform(random);
  return matrix;
}

const Material kSoft{1e4, 0.45};

TEST(CorotationalElement, SplitsEveryGradientIntoARotationAndStretches) {
  std::mt19937 random(3);
  std::vector<Eigen::Matrix3d> gradients{Eigen::Matrix3d::Identity(), -Eigen::Matrix3d::Identity(),
                                         Eigen::Matrix3d::Zero(), Vector3(1, 1, 0).asDiagonal()};
  for (int i = 0; i < 100; ++i) gradients.push_back(random_matrix(random));
  for (const Eigen::Matrix3d& gradient : gradients) {
    const PrincipalStretches split = principal_stretches(gradient);
    EXPECT_LT((split.left * split.stretch.asDiagonal() * split.right.transpose() - gradient).norm(), 1e-14);
    EXPECT_NEAR(split.rotation().determinant(), 1, 1e-14);
    EXPECT_LT((split.rotation().transpose() * split.rotation() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
  }
}

TEST(CorotationalElement, StressIsTheDerivativeOfTheEnergy) {
  std::mt19937 random(4);
  double largest = 0;
  for (int i = 0; i < 50; ++i) {
    const Eigen::Matrix3d gradient = Eigen::Matrix3d::Identity() + 0.4 * random_matrix(random);
    const Eigen::Matrix3d direction = random_matrix(random);
    const double step = 1e-5;
    const double difference = (energy_density(kSoft, principal_stretches(gradient + step * direction)) -
                               energy_density(kSoft, principal_stretches(gradient - step * direction))) /
                              (2 * step);
    const Eigen::Matrix3d stress_pa = first_piola_stress(kSoft, principal_stretches(gradient));
    largest = std::max(largest, std::abs(difference - stress_pa.cwiseProduct(direction).sum()) /
                                    (stress_pa.norm() * direction.norm()));
  }
  EXPECT_LT(largest, 1e-8);
}

TEST(CorotationalElement, StiffnessIsTheDerivativeOfTheForces) {
  const TetMesh mesh{
      {{0, 0, 0}, {0.01, 0, 0}, {0.002, 0.012, 0}, {0.003, 0.001, 0.009}}, {{0, 1, 2, 3}}, {0}};
  const LinearElement element = element_of(mesh, 0);
  std::mt19937 random(5);
  double largest = 0;
  for (int i = 0; i < 50; ++i) {
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(3 * uniform(random), Vector3(1, 2, uniform(random)).normalized()).matrix();
    const Eigen::Matrix3d gradient = turn * (Eigen::Matrix3d::Identity() + 0.3 * random_matrix(random));
    Eigen::Matrix<double, 4, 3> displacements_m, direction_m;
    for (Eigen::Index a = 0; a < 4; ++a) {
      displacements_m.row(a) =
          ((gradient - Eigen::Matrix3d::Identity()) * mesh.nodes[static_cast<std::size_t>(a)]).transpose();
      for (Eigen::Index c = 0; c < 3; ++c) direction_m(a, c) = 0.01 * uniform(random);
    }
    const auto forces_n = [&](double step) {
      const Eigen::Matrix3d stress_pa = first_piola_stress(
          kSoft, principal_stretches(deformation_gradient(element, displacements_m + step * direction_m)));
      Eigen::Matrix<double, 12, 1> all_n;
      for (Eigen::Index a = 0; a < 4; ++a)
        all_n.segment<3>(3 * a) = element.volume_m3 * stress_pa * element.gradients.row(a).transpose();
      return all_n;
    };
    Eigen::Matrix<double, 12, 1> moved_m;
    for (Eigen::Index a = 0; a < 4; ++a) moved_m.segment<3>(3 * a) = direction_m.row(a).transpose();
    const ElementMatrix stiffness = corotational_stiffness(
        element, kSoft, principal_stretches(deformation_gradient(element, displacements_m)),
        Curvature::kExact);
    const Eigen::Matrix<double, 12, 1> difference = (forces_n(1e-5) - forces_n(-1e-5)) / 2e-5;
    largest = std::max(largest, (stiffness * moved_m - difference).norm() / difference.norm());
  }
  EXPECT_LT(largest, 1e-6);
}

TEST(CorotationalElement, StiffnessIsTheLinearOneAtRestAndTheConvexOneIsNeverNegative) {
  const TetMesh mesh{
      {{0, 0, 0}, {0.01, 0, 0}, {0.002, 0.012, 0}, {0.003, 0.001, 0.009}}, {{0, 1, 2, 3}}, {0}};
  const LinearElement element = element_of(mesh, 0);
  const ElementMatrix rest = corotational_stiffness(
      element, kSoft, principal_stretches(Eigen::Matrix3d::Identity()), Curvature::kExact);
  for (Eigen::Index a = 0; a < 4; ++a) {
    for (Eigen::Index b = 0; b < 4; ++b) {
      EXPECT_LT((rest.block<3, 3>(3 * a, 3 * b) - stiffness_block(element, kSoft, a, b)).norm(),
                1e-13 * rest.norm());
    }
  }
  std::mt19937 random(6);
  for (int i = 0; i < 100; ++i) {
    const ElementMatrix stiffness = corotational_stiffness(
        element, kSoft, principal_stretches(2 * random_matrix(random)), Curvature::kConvex);
    const Eigen::VectorXd eigenvalues = stiffness.selfadjointView<Eigen::Lower>().eigenvalues();
    EXPECT_GT(eigenvalues.minCoeff(), -1e-12 * eigenvalues.maxCoeff());
  }
}

TEST(CorotationalBody, FollowsLargeRotationsWithoutStressAndKeepsItsVolume) {
  const TetMesh mesh = tet_grid({3, 3, 3}, {0.1, 0.1, 0.1});
  double largest_pa = 0, largest_change = 0;
  for (const double degrees : {10.0, 90.0, 170.0}) {
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(degrees / 180 * 3.14159265358979, Vector3(1, -2, 3).normalized()).matrix();
    Constraints constraints(mesh.nodes.size());
    for (const std::size_t node : {0U, 3U, 15U, 48U})
      constraints.prescribe(node, turn * mesh.nodes[node] - mesh.nodes[node], "test");
    const CorotationalBody body(mesh, {{0, kSoft}}, constraints);
    const CorotationalBody::Solution solution =
        body.solve(Eigen::VectorXd::Zero(first_row(mesh.nodes.size())));
    for (const SymmetricTensor& stress : body.stress_pa(solution.displacement_m))
      largest_pa = std::max(largest_pa, stress.norm());
    largest_change = std::max(largest_change, std::abs(volume_m3(mesh, solution.displacement_m) /
                                                           volume_m3(mesh, 0 * solution.displacement_m) -
                                                       1));
    EXPECT_LT(solution.reaction_force_n.norm(), 1e-9 * kSoft.young_modulus_pa * 0.1 * 0.1);
  }
  EXPECT_LT(largest_pa, 1e-9 * kSoft.young_modulus_pa);
  EXPECT_LT(largest_change, 1e-9);
  record("stress_by_modulus", largest_pa / kSoft.young_modulus_pa);
  record("volume_change", largest_change);
}

/// A slender beam along x, held at x = 0, and the force -z that its other end carries.
struct Beam {
  TetMesh mesh = tet_grid({40, 4, 4}, {0.1, 0.01, 0.01});
  Constraints constraints{mesh.nodes.size()};
  std::vector<std::size_t> end;
  Beam() {
    for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
      if (mesh.nodes[node].x() == 0) constraints.prescribe(node, Vector3::Zero(), "test");
      if (mesh.nodes[node].x() > 0.0999) end.push_back(node);
    }
  }
  [[nodiscard]] Eigen::VectorXd force_n(double total_n) const {
    Eigen::VectorXd force_n = Eigen::VectorXd::Zero(first_row(mesh.nodes.size()));
    for (const std::size_t node : end)
      force_n[first_row(node) + 2] = -total_n / static_cast<double>(end.size());
    return force_n;
  }
  [[nodiscard]] Vector3 mean_at_end(const Eigen::VectorXd& displacement_m) const {
    Vector3 sum = Vector3::Zero();
    for (const std::size_t node : end) sum += displacement_m.segment<3>(first_row(node));
    return sum / static_cast<double>(end.size());
  }
};

TEST(CorotationalBody, SmallLoadsGiveTheLinearSolution) {
  const Beam beam;
  const CorotationalBody body(beam.mesh, {{0, kSoft}}, beam.constraints);
  const Eigen::VectorXd force_n = beam.force_n(1e-7);
  const Eigen::VectorXd linear_m = body.linear().solve(force_n).displacement_m;
  const Eigen::VectorXd found_m = body.solve(force_n).displacement_m;
  const double size = linear_m.lpNorm<Eigen::Infinity>();
  EXPECT_LT((found_m - linear_m).lpNorm<Eigen::Infinity>() / size, 10 * size / 0.01);
}

TEST(CorotationalBody, BendsAsTheElasticaAndKeepsItsVolumeWhereLinearElementsSwell) {
  // Mattiasson, "Numerical results from large deflection beam and frame problems", 1981, table 1: the end of
  // a cantilever under P L^2 / E I, in lengths. What linear tetrahedra are too stiff by is taken out by
  // measuring E I with a small load.
  struct Row {
    double load, down, inwards;
  };
  const Beam beam;
  const double length_m = 0.1;
  const CorotationalBody body(beam.mesh, {{0, {1e6, 0.3}}}, beam.constraints);
  const double unit_n = 1e-4;
  const double flexibility =
      -beam.mean_at_end(body.linear().solve(beam.force_n(unit_n)).displacement_m).z() / unit_n;
  const double bending_nm2 = length_m * length_m * length_m / (3 * flexibility);
  double largest = 0, swelling = 0, change = 0;
  for (const Row& row : {Row{1, 0.30172, 0.05643}, Row{2, 0.49346, 0.16064}, Row{5, 0.71379, 0.38763}}) {
    const Eigen::VectorXd force_n = beam.force_n(row.load * bending_nm2 / (length_m * length_m));
    const CorotationalBody::Solution solution = body.solve(force_n);
    const Vector3 moved_m = beam.mean_at_end(solution.displacement_m);
    largest = std::max({largest, std::abs(-moved_m.z() / length_m - row.down),
                        std::abs(-moved_m.x() / length_m - row.inwards)});
    const double at_rest_m3 = volume_m3(beam.mesh, 0 * force_n);
    change = std::max(change, std::abs(volume_m3(beam.mesh, solution.displacement_m) / at_rest_m3 - 1));
    swelling = volume_m3(beam.mesh, body.linear().solve(force_n).displacement_m) / at_rest_m3 - 1;
    EXPECT_LT(solution.factorisations, 40);
    record("factorisations", solution.factorisations);
    Vector3 reaction_n = Vector3::Zero();
    for (Eigen::Index i = 0; i < force_n.size(); i += 3)
      reaction_n += solution.reaction_force_n.segment<3>(i) + force_n.segment<3>(i);
    EXPECT_LT(reaction_n.norm(), 1e-8 * force_n.lpNorm<1>());
  }
  EXPECT_LT(largest, 0.02) << "of the length";
  EXPECT_LT(change, 0.01);
  EXPECT_GT(swelling, 0.5);
  record("off_the_elastica", largest);
  record("volume_change", change);
  record("linear_swelling", swelling);
}

TEST(CorotationalBody, GivesTheSameBitsTwice) {
  const Beam beam;
  const CorotationalBody body(beam.mesh, {{0, kSoft}}, beam.constraints);
  EXPECT_EQ(body.solve(beam.force_n(1e-4)).displacement_m, body.solve(beam.force_n(1e-4)).displacement_m);
}

TEST(CorotationalBody, RefusesWhatCrushesIt) {
  TetMesh mesh = tet_grid({2, 2, 2}, {0.1, 0.1, 0.1});
  Constraints constraints(mesh.nodes.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    // The right side pushed through the left.
    if (mesh.nodes[node].x() == 0) constraints.prescribe(node, Vector3::Zero(), "test");
    if (mesh.nodes[node].x() == 0.1) constraints.prescribe(node, Vector3(-0.15, 0, 0), "test");
  }
  const CorotationalBody body(mesh, {{0, {1e4, 0.3}}}, constraints);
  try {
    (void)body.solve(Eigen::VectorXd::Zero(first_row(mesh.nodes.size())));
    FAIL() << "found an equilibrium";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no equilibrium is found beyond"));
  }
}

}  // namespace
}  // namespace kiroku::sim

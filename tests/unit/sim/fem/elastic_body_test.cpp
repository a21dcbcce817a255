// Physical laws that every solution obeys, and what is refused.
#include "sim/fem/elastic_body.h"

#include <random>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using test::tet_grid;
using testing::HasSubstr;

constexpr double kExact = 1e-9;

Eigen::Index at(std::size_t node, std::size_t component = 0) {
  return static_cast<Eigen::Index>(3 * node + component);
}

bool on_surface(const Vector3& node, const Vector3& size_m) {
  return (node.array() <= 1e-12).any() || ((size_m - node).array() <= 1e-12).any();
}

/// A grid whose inner nodes are moved about, so that no two elements are alike; two regions, left and right.
TetMesh uneven_grid(const Vector3& size_m) {
  constexpr std::uint32_t kCells = 4;
  TetMesh mesh = tet_grid({kCells, kCells, kCells}, size_m);
  std::mt19937 random(7);
  for (Vector3& node : mesh.nodes) {
    if (on_surface(node, size_m)) continue;
    for (Eigen::Index i = 0; i < 3; ++i) {
      node[i] += size_m[i] / kCells * 0.2 * (static_cast<double>(random()) / 4294967296.0 - 0.5);
    }
  }
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    double x = 0;
    for (const std::uint32_t node : mesh.tetrahedra[t]) x += mesh.nodes[node].x() / 4;
    mesh.regions[t] = x < size_m.x() / 2 ? 1 : 2;
  }
  return mesh;
}

const Materials kAlike{{1, {1e4, 0.45}}, {2, {1e4, 0.45}}};
const Materials kDifferent{{1, {3e3, 0.45}}, {2, {5e4, 0.3, 1060}}};

Constraints held_at_left(const TetMesh& mesh) {
  Constraints constraints(mesh.nodes.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (mesh.nodes[node].x() == 0) constraints.prescribe(node, Vector3::Zero(), "test");
  }
  return constraints;
}

Eigen::VectorXd random_forces(std::size_t nodes, unsigned seed) {
  std::mt19937 random(seed);
  Eigen::VectorXd force_n(at(nodes));
  for (double& component : force_n) component = static_cast<double>(random()) / 4294967296.0 - 0.5;
  return force_n;
}

/// A relative error, to be smaller than kExact; docs/results/simulation-validation.md tells what it was.
void expect_exact(const char* what, double relative_error) {
  EXPECT_LE(relative_error, kExact) << what;
  char text[32];
  std::snprintf(text, sizeof text, "%.1e", relative_error);
  testing::Test::RecordProperty(what, text);
}

TEST(ElasticBody, PassesThePatchTest) {
  const Vector3 size_m(0.1, 0.2, 0.15);
  const TetMesh mesh = uneven_grid(size_m);
  Eigen::Matrix3d gradient;
  gradient << 0.01, -0.02, 0.005, 0.004, 0.03, 0.01, -0.015, 0.002, -0.02;
  Constraints constraints(mesh.nodes.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (on_surface(mesh.nodes[node], size_m))
      constraints.prescribe(node, gradient * mesh.nodes[node], "test");
  }
  const ElasticBody body(mesh, kAlike, constraints);
  EXPECT_EQ(body.unknowns(), 3U * 27);
  const Eigen::VectorXd displacement_m =
      body.solve(Eigen::VectorXd::Zero(at(mesh.nodes.size()))).displacement_m;
  double error_m = 0, error_pa = 0, error_strain = 0;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    error_m = std::max(error_m, (displacement_m.segment<3>(at(node)) - gradient * mesh.nodes[node]).norm());
  }
  SymmetricTensor strain;
  strain << 0.01, 0.03, -0.02, -0.008, 0.006, -0.005;
  const SymmetricTensor stress_pa = stress_of(kAlike.at(1), strain);
  for (const SymmetricTensor& found : body.stress_pa(displacement_m)) {
    error_pa = std::max(error_pa, (found - stress_pa).norm());
  }
  for (const SymmetricTensor& found : body.at_nodes(body.strain(displacement_m))) {
    error_strain = std::max(error_strain, (found - strain).norm());
  }
  expect_exact("displacement", error_m / displacement_m.lpNorm<Eigen::Infinity>());
  expect_exact("stress", error_pa / stress_pa.norm());
  expect_exact("strain_at_nodes", error_strain / strain.norm());
}

TEST(ElasticBody, FollowsARigidMotionWithoutStress) {
  const TetMesh mesh = uneven_grid({0.1, 0.1, 0.1});
  const Vector3 turn(0.3, -0.2, 0.5), move_m(0.01, 0.02, -0.03);
  const auto moved = [&](const Vector3& point) -> Vector3 { return move_m + turn.cross(point); };
  Constraints constraints(mesh.nodes.size());
  for (const std::size_t node : {0U, 4U, 24U, 70U})
    constraints.prescribe(node, moved(mesh.nodes[node]), "test");
  const ElasticBody body(mesh, kDifferent, constraints);
  const StaticSolution solution = body.solve(Eigen::VectorXd::Zero(at(mesh.nodes.size())));
  double error_m = 0, error_pa = 0;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    error_m =
        std::max(error_m, (solution.displacement_m.segment<3>(at(node)) - moved(mesh.nodes[node])).norm());
  }
  for (const SymmetricTensor& stress_pa : body.stress_pa(solution.displacement_m)) {
    error_pa = std::max(error_pa, stress_pa.norm());
  }
  const double modulus_pa = kDifferent.at(2).young_modulus_pa;
  expect_exact("displacement", error_m / move_m.norm());
  expect_exact("stress", error_pa / (modulus_pa * turn.norm()));
  expect_exact("reaction", solution.reaction_force_n.norm() / (modulus_pa * turn.norm() * 0.1 * 0.1));
}

TEST(ElasticBody, IsReciprocal) {
  // Betti: the work of one load on the displacements of another is that of the other on the one's.
  const TetMesh mesh = uneven_grid({0.1, 0.1, 0.1});
  const ElasticBody body(mesh, kDifferent, held_at_left(mesh));
  const Eigen::VectorXd one_n = random_forces(mesh.nodes.size(), 1),
                        other_n = random_forces(mesh.nodes.size(), 2);
  const double work = other_n.dot(body.solve(one_n).displacement_m);
  expect_exact("work", std::abs(one_n.dot(body.solve(other_n).displacement_m) / work - 1));
}

TEST(ElasticBody, MirroredBodiesMoveAsMirrorImages) {
  const TetMesh mesh = uneven_grid({0.1, 0.1, 0.1});
  TetMesh mirrored = mesh;
  for (Vector3& node : mirrored.nodes) node.y() = -node.y();
  for (Tetrahedron& corners : mirrored.tetrahedra) std::swap(corners[0], corners[1]);
  const Eigen::VectorXd force_n = random_forces(mesh.nodes.size(), 3);
  Eigen::VectorXd mirror = Eigen::VectorXd::Ones(force_n.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) mirror[at(node, 1)] = -1;
  const Eigen::VectorXd expected_m =
      mirror.cwiseProduct(ElasticBody(mesh, kDifferent, held_at_left(mesh)).solve(force_n).displacement_m);
  const Eigen::VectorXd found_m = ElasticBody(mirrored, kDifferent, held_at_left(mirrored))
                                      .solve(mirror.cwiseProduct(force_n))
                                      .displacement_m;
  expect_exact("displacement", (found_m - expected_m).norm() / expected_m.norm());
}

TEST(ElasticBody, StoresTheWorkThatForcesDo) {
  const TetMesh mesh = uneven_grid({0.1, 0.1, 0.1});
  const ElasticBody body(mesh, kDifferent, held_at_left(mesh));
  const Eigen::VectorXd force_n = random_forces(mesh.nodes.size(), 4);
  const Eigen::VectorXd displacement_m = body.solve(force_n).displacement_m;
  const auto strain = body.strain(displacement_m), stress_pa = body.stress_pa(displacement_m);
  double energy_j = 0;
  for (std::size_t t = 0; t < strain.size(); ++t) {
    const double density =
        strain[t].head<3>().dot(stress_pa[t].head<3>()) + 2 * strain[t].tail<3>().dot(stress_pa[t].tail<3>());
    energy_j += density * signed_volume_m3(mesh, t) / 2;
  }
  const double work_j = force_n.dot(displacement_m) / 2;
  EXPECT_GT(work_j, 0);
  expect_exact("energy", std::abs(energy_j / work_j - 1));
}

TEST(ElasticBody, ReactionsBalanceLoadsAndTheirMoments) {
  const TetMesh mesh = uneven_grid({0.1, 0.1, 0.1});
  Constraints constraints = held_at_left(mesh);
  constraints.prescribe(124, 2, -0.01, "a finger");  // one component only, at the far corner
  const ElasticBody body(mesh, kDifferent, constraints);
  const Eigen::VectorXd loads_n = 1e-2 * random_forces(mesh.nodes.size(), 5) + body.weight_n({0, 0, -9.81});
  const StaticSolution solution = body.solve(loads_n);
  EXPECT_EQ(solution.displacement_m[at(124, 2)], -0.01);
  EXPECT_EQ(solution.reaction_force_n[at(124, 0)], 0);
  EXPECT_NE(solution.reaction_force_n[at(124, 2)], 0);
  Vector3 force_n = Vector3::Zero(), moment_nm = Vector3::Zero();
  double scale_n = 0;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    const Vector3 here_n = loads_n.segment<3>(at(node)) + solution.reaction_force_n.segment<3>(at(node));
    force_n += here_n;
    moment_nm += mesh.nodes[node].cross(here_n);
    scale_n += here_n.norm();
  }
  expect_exact("force", force_n.norm() / scale_n);
  expect_exact("moment", moment_nm.norm() / (scale_n * 0.1));
}

TEST(ElasticBody, WeighsWhatItsVolumeWeighs) {
  const TetMesh mesh = tet_grid({2, 2, 2}, {0.1, 0.2, 0.3});
  Constraints constraints(mesh.nodes.size());
  for (const std::size_t node : {0U, 2U, 8U}) constraints.prescribe(node, Vector3::Zero(), "test");
  const ElasticBody body(mesh, {{0, {1e4, 0.45, 1060}}}, constraints);
  const Eigen::VectorXd weight_n = body.weight_n({0, 0, -10});
  double sum_n = 0;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) sum_n += weight_n[at(node, 2)];
  EXPECT_NEAR(sum_n, -10 * 1060 * 0.006, 1e-12);
}

/// Mean deflection of the end of a beam of 50 x 10 x 10 mm, E 10 kPa, nu 0.3, loaded by 1 mN, relative to
/// Timoshenko's.
double relative_deflection(std::uint32_t cells) {
  const double length_m = 0.05, side_m = 0.01, e = 1e4, nu = 0.3, load_n = 1e-3;
  const TetMesh mesh = tet_grid({5 * cells, cells, cells}, {length_m, side_m, side_m});
  const ElasticBody body(mesh, {{0, {e, nu}}}, held_at_left(mesh));
  std::vector<std::size_t> end;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (mesh.nodes[node].x() > length_m - 1e-9) end.push_back(node);
  }
  // Shear spread evenly: by area, half as much at edges, a quarter at corners.
  Eigen::VectorXd force_n = Eigen::VectorXd::Zero(at(mesh.nodes.size()));
  for (const std::size_t node : end) {
    double share = 1.0 / (cells * cells);
    for (Eigen::Index axis = 1; axis < 3; ++axis) {
      const double along = mesh.nodes[node][axis];
      if (along < 1e-9 || along > side_m - 1e-9) share /= 2;
    }
    force_n[at(node, 2)] = -load_n * share;
  }
  const Eigen::VectorXd displacement_m = body.solve(force_n).displacement_m;
  double mean_m = 0;
  for (const std::size_t node : end) mean_m -= displacement_m[at(node, 2)] / static_cast<double>(end.size());
  const double inertia_m4 = std::pow(side_m, 4) / 12, shear_pa = e / (2 * (1 + nu));
  // Cowper's shear coefficient of a rectangle.
  const double coefficient = 10 * (1 + nu) / (12 + 11 * nu);
  const double bending_m = load_n * std::pow(length_m, 3) / (3 * e * inertia_m4);
  const double shear_m = load_n * length_m / (coefficient * shear_pa * side_m * side_m);
  return mean_m / (bending_m + shear_m);
}

TEST(ElasticBody, CantileverConvergesToTimoshenko) {
  const double coarse = relative_deflection(3), medium = relative_deflection(6),
               fine = relative_deflection(12);
  RecordProperty("relative_deflections",
                 std::to_string(coarse) + " " + std::to_string(medium) + " " + std::to_string(fine));
  // Too stiff (linear tetrahedra lock), less so with each refinement, at nearly second order.
  EXPECT_LT(coarse, medium);
  EXPECT_LT(medium, fine);
  EXPECT_LT(fine, 1);
  const double order = std::log2((medium - coarse) / (fine - medium));
  EXPECT_GT(order, 0.8);
  EXPECT_LT(order, 2.2);
  // Aitken's extrapolation of the three: what the clamped root and locking leave is a percent.
  const double limit = fine + (fine - medium) * (fine - medium) / ((medium - coarse) - (fine - medium));
  EXPECT_NEAR(limit, 1, 0.02) << coarse << " " << medium << " " << fine;
}

TEST(ElasticBody, GivesTheSameBitsTwice) {
  const TetMesh mesh = uneven_grid({0.1, 0.1, 0.1});
  const Eigen::VectorXd force_n = random_forces(mesh.nodes.size(), 6);
  const StaticSolution one = ElasticBody(mesh, kDifferent, held_at_left(mesh)).solve(force_n);
  const StaticSolution other = ElasticBody(mesh, kDifferent, held_at_left(mesh)).solve(force_n);
  EXPECT_EQ(one.displacement_m, other.displacement_m);
  EXPECT_EQ(one.reaction_force_n, other.reaction_force_n);
}

TEST(ElasticBody, SolvesNothingWhereEverythingIsPrescribed) {
  const TetMesh mesh = tet_grid({1, 1, 1}, {1, 1, 1});
  Constraints constraints(mesh.nodes.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node)
    constraints.prescribe(node, mesh.nodes[node] * 0.1, "test");
  const ElasticBody body(mesh, {{0, {1e4, 0.3}}}, constraints);
  EXPECT_EQ(body.unknowns(), 0U);
  EXPECT_EQ(body.solve(Eigen::VectorXd::Zero(at(8))).displacement_m[at(7)], 0.1);
}

TEST(ElasticBody, LeavesLooseNodesAlone) {
  TetMesh mesh = tet_grid({1, 1, 1}, {1, 1, 1});
  mesh.nodes.emplace_back(9, 9, 9);
  const ElasticBody body(mesh, {{0, {1e4, 0.3}}}, held_at_left(mesh));
  Eigen::VectorXd force_n = Eigen::VectorXd::Zero(at(9));
  force_n[at(7)] = 1;
  const StaticSolution solution = body.solve(force_n);
  EXPECT_EQ(solution.displacement_m.segment<3>(at(8)), Vector3::Zero());
  EXPECT_EQ(body.at_nodes(body.stress_pa(solution.displacement_m))[8], SymmetricTensor::Zero());
}

std::string refusal(const TetMesh& mesh, const Materials& materials, const Constraints& constraints) {
  try {
    const ElasticBody body(mesh, materials, constraints);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(ElasticBody, RefusesUnsoundMaterials) {
  const TetMesh mesh = tet_grid({1, 1, 1}, {1, 1, 1});
  const auto with = [&](double e, double nu, double density = 1000) {
    return refusal(mesh, {{0, {e, nu, density}}}, held_at_left(mesh));
  };
  EXPECT_EQ(with(-5, 0.3), "the young_modulus_pa of region 0 is -5: stiffness must be greater than 0");
  EXPECT_THAT(with(0, 0.3), HasSubstr("is 0: stiffness"));
  EXPECT_THAT(with(NAN, 0.3), HasSubstr("nan"));
  EXPECT_EQ(
      with(1e3, 0.5),
      "the poisson_ratio of region 0 is 0.5: material without any change of volume cannot be computed; take "
      "0.49, or 0.45 for soft tissue");
  EXPECT_THAT(with(1e3, 0.51), HasSubstr("is 0.51: it must lie between -1 and 0.5"));
  EXPECT_THAT(with(1e3, -1), HasSubstr("is -1: it must lie"));
  EXPECT_THAT(with(1e3, NAN), HasSubstr("nan"));
  EXPECT_THAT(with(1.7e308, 0.499999), HasSubstr("out of all proportion"));
  EXPECT_THAT(with(1e3, 0.3, -1), HasSubstr("density_kg_m3 of region 0 is -1"));
  EXPECT_EQ(with(1e3, 0.3), "");
  EXPECT_EQ(refusal(mesh, {{1, {1e3, 0.3}}}, held_at_left(mesh)), "region 0 has no material");
}

TEST(ElasticBody, RefusesUnsoundMeshes) {
  TetMesh mesh = tet_grid({1, 1, 1}, {1, 1, 1});
  std::swap(mesh.tetrahedra[3][0], mesh.tetrahedra[3][1]);
  EXPECT_EQ(refusal(mesh, {{0, {1e3, 0.3}}}, held_at_left(mesh)),
            "the mesh is not sound: 1 tetrahedron is inverted: 3");
}

TEST(ElasticBody, LeavesNothingThatIsNotFinite) {
  const TetMesh mesh = tet_grid({2, 2, 2}, {1, 1, 1});
  const ElasticBody body(mesh, {{0, {1e3, 0.3}}}, held_at_left(mesh));
  Eigen::VectorXd force_n = Eigen::VectorXd::Zero(at(mesh.nodes.size()));
  force_n[at(8)] = 1e308;
  EXPECT_THROW(body.stress_pa(body.solve(force_n).displacement_m), Error);
  force_n[at(8)] = 1e-300;
  EXPECT_TRUE(body.solve(force_n).displacement_m.allFinite());
}

TEST(Constraints, RefusesContradictions) {
  Constraints constraints(3);
  constraints.prescribe(1, 2, 0.5, "fixed[0]");
  EXPECT_NO_THROW(constraints.prescribe(1, 2, 0.5, "fixed[1]"));
  try {
    constraints.prescribe(1, 2, 0.25, "fixed[2]");
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(),
                 "fixed[2] moves node 1 by 0.25 m along z, fixed[0] by 0.5 m: only one of them can be");
  }
}

}  // namespace
}  // namespace kiroku::sim

// Node by node against CalculiX (ccx), with the same nodes, tetrahedra and loads. Skipped where ccx or the
// mesh is absent.
#include "tests/support/calculix.h"

#include <cmath>

#include <gtest/gtest.h>

#include "sim/fem/elastic_body.h"
#include "sim/mesh/degrees_of_freedom.h"
#include "sim/mesh/mesh_reader.h"
#include "tests/support/shared_data.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

constexpr double kAgreement = 1e-5;  // of the largest value; ccx prints seven digits

using Case = test::CalculixCase;

/// Held in the lowest tenth along its longest side, pulled sideways at the highest tenth, one node there
/// moved along one axis, with weight; left and right of its middle of different tissue.
Case case_of(TetMesh mesh) {
  Case made;
  made.mesh = std::move(mesh);
  const Extent extent = extent_of(made.mesh);
  const Vector3 size_m = extent.greatest - extent.least;
  Eigen::Index axis = 0;
  size_m.maxCoeff(&axis);
  for (std::size_t t = 0; t < made.mesh.tetrahedra.size(); ++t) {
    const double x_m = made.mesh.nodes[made.mesh.tetrahedra[t][0]].x();
    made.mesh.regions[t] = x_m < extent.least.x() + size_m.x() / 2 ? 1 : 2;
  }
  made.materials = {{1, {3e3, 0.45, 1050}}, {2, {1e4, 0.3, 1000}}};
  made.constraints = Constraints(made.mesh.nodes.size());
  made.force_n = Eigen::VectorXd::Zero(first_row(made.mesh.nodes.size()));
  const std::vector<bool> used = nodes_in_use(made.mesh);
  bool moved = false;
  for (std::size_t node = 0; node < made.mesh.nodes.size(); ++node) {
    if (!used[node]) continue;
    const double along = (made.mesh.nodes[node][axis] - extent.least[axis]) / size_m[axis];
    if (along <= 0.1) made.constraints.prescribe(node, Vector3::Zero(), "test");
    if (along < 0.9) continue;
    made.force_n.segment<3>(first_row(node)) = Vector3(1e-3, -2e-3, 5e-4);
    if (!moved) made.constraints.prescribe(node, 1, 0.01 * size_m[axis], "test");
    moved = true;
  }
  return made;
}

void expect_agreement(TetMesh mesh, testing::Test& test) {
  const Case input = case_of(std::move(mesh));
  const ElasticBody body(input.mesh, input.materials, input.constraints);
  const Eigen::VectorXd force_n = input.force_n + body.weight_n({0, 0, -9.81});
  const Eigen::VectorXd displacement_m = body.solve(force_n).displacement_m;
  const std::vector<SymmetricTensor> stress_pa = body.stress_pa(displacement_m);

  const test::CalculixResult theirs = test::run_calculix(input, force_n);
  const std::vector<bool> used = nodes_in_use(input.mesh);
  ASSERT_EQ(theirs.nodes, static_cast<std::size_t>(std::ranges::count(used, true)));
  ASSERT_EQ(theirs.tetrahedra, input.mesh.tetrahedra.size());

  double largest_m = 0, difference_m = 0, largest_pa = 0, difference_pa = 0;
  for (std::size_t node = 0; node < input.mesh.nodes.size(); ++node) {
    const Vector3 ours_m = displacement_m.segment<3>(first_row(node)),
                  theirs_m = theirs.displacement_m.segment<3>(first_row(node));
    largest_m = std::max(largest_m, theirs_m.norm());
    difference_m = std::max(difference_m, (ours_m - theirs_m).norm());
  }
  for (std::size_t t = 0; t < stress_pa.size(); ++t) {
    largest_pa = std::max(largest_pa, theirs.stress_pa[t].norm());
    difference_pa = std::max(difference_pa, (stress_pa[t] - theirs.stress_pa[t]).norm());
  }
  EXPECT_LE(difference_m, kAgreement * largest_m);
  EXPECT_LE(difference_pa, kAgreement * largest_pa);
  test.RecordProperty("displacement_difference", std::to_string(difference_m / largest_m * 1e9) + "e-9");
  test.RecordProperty("stress_difference", std::to_string(difference_pa / largest_pa * 1e9) + "e-9");
}

TEST(Calculix, AgreesOnABeam) {
  if (!test::has_ccx()) GTEST_SKIP() << "ccx is not installed";
  expect_agreement(test::tet_grid({20, 4, 4}, {0.1, 0.02, 0.02}), *this);
}

class CalculixOnRealMeshes : public testing::TestWithParam<const char*> {};

TEST_P(CalculixOnRealMeshes, Agrees) {
  const std::string file = std::string("sim/meshes/") + GetParam();
  KIROKU_NEEDS_SHARED_DATA(file);
  if (!test::has_ccx()) GTEST_SKIP() << "ccx is not installed";
  TetMesh mesh = read_mesh(test::shared_data(file), LengthUnit::kMetre).mesh;
  const double longest_m = extent_of(mesh).longest_side_m();
  for (Vector3& node : mesh.nodes)
    node *= 0.2 / longest_m;  // the length of a liver, whatever unit the file is in
  expect_agreement(std::move(mesh), *this);
}

INSTANTIATE_TEST_SUITE_P(Meshes, CalculixOnRealMeshes,
                         testing::Values("sofa_env/liver_volumetric.vtk",
                                         "sofa_env/gallbladder_volumetric.vtk", "sofa_env/tissue_volume.msh",
                                         "sofa_env/tissue_volumetric.msh",
                                         "vega/turtle-volumetric-homogeneous.veg"),
                         [](const auto& test) {
                           const std::string file = test.param;
                           std::string name = file.substr(file.find('/') + 1);
                           std::ranges::replace_if(
                               name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; },
                               '_');
                           return name;
                         });

}  // namespace
}  // namespace kiroku::sim

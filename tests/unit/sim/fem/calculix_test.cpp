// Node by node against CalculiX (ccx), with the same nodes, tetrahedra and loads. Skipped where ccx or the
// mesh is absent.
#include <cmath>
#include <cstdlib>
#include <sstream>

#include <gtest/gtest.h>

#include "sim/fem/elastic_body.h"
#include "sim/mesh/mesh_reader.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

constexpr double kAgreement = 1e-5;  // of the largest value; ccx prints seven digits

Eigen::Index at(std::size_t node) { return static_cast<Eigen::Index>(3 * node); }

bool has_ccx() { return std::system("ccx -v >/dev/null 2>&1 </dev/null") != 127 << 8; }

/// Text that ccx reads: at most 20 characters.
std::string digits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.12e", value);
  return text;
}

struct Case {
  TetMesh mesh;
  Materials materials;
  Constraints constraints{0};
  Eigen::VectorXd force_n;
};

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
  made.force_n = Eigen::VectorXd::Zero(at(made.mesh.nodes.size()));
  const std::vector<bool> used = nodes_in_use(made.mesh);
  bool moved = false;
  for (std::size_t node = 0; node < made.mesh.nodes.size(); ++node) {
    if (!used[node]) continue;
    const double along = (made.mesh.nodes[node][axis] - extent.least[axis]) / size_m[axis];
    if (along <= 0.1) made.constraints.prescribe(node, Vector3::Zero(), "test");
    if (along < 0.9) continue;
    made.force_n.segment<3>(at(node)) = Vector3(1e-3, -2e-3, 5e-4);
    if (!moved) made.constraints.prescribe(node, 1, 0.01 * size_m[axis], "test");
    moved = true;
  }
  return made;
}

std::string calculix_input(const Case& input, const Eigen::VectorXd& force_n) {
  std::ostringstream out;
  out << "*NODE, NSET=ALL\n";
  const std::vector<bool> used = nodes_in_use(input.mesh);
  for (std::size_t node = 0; node < input.mesh.nodes.size(); ++node) {
    const Vector3& position = input.mesh.nodes[node];
    if (used[node]) {
      out << node + 1 << ", " << digits(position.x()) << ", " << digits(position.y()) << ", "
          << digits(position.z()) << "\n";
    }
  }
  for (const auto& [region, material] : input.materials) {
    out << "*ELEMENT, TYPE=C3D4, ELSET=R" << region << "\n";
    for (std::size_t t = 0; t < input.mesh.tetrahedra.size(); ++t) {
      if (input.mesh.regions[t] != region) continue;
      out << t + 1;
      for (const std::uint32_t node : input.mesh.tetrahedra[t]) out << ", " << node + 1;
      out << "\n";
    }
    out << "*MATERIAL, NAME=M" << region << "\n*ELASTIC\n"
        << digits(material.young_modulus_pa) << ", " << digits(material.poisson_ratio)
        << "\n*SOLID SECTION, ELSET=R" << region << ", MATERIAL=M" << region << "\n";
  }
  out << "*STEP\n*STATIC, SOLVER=SPOOLES\n*BOUNDARY\n";
  for (std::size_t number = 0; number < 3 * input.mesh.nodes.size(); ++number) {
    if (!input.constraints.prescribed(number)) continue;
    const double displacement_m = input.constraints.displacement_m()[static_cast<Eigen::Index>(number)];
    out << number / 3 + 1 << ", " << number % 3 + 1 << ", " << number % 3 + 1 << ", "
        << digits(displacement_m) << "\n";
  }
  out << "*CLOAD\n";
  for (Eigen::Index number = 0; number < force_n.size(); ++number) {
    if (force_n[number] != 0)
      out << number / 3 + 1 << ", " << number % 3 + 1 << ", " << digits(force_n[number]) << "\n";
  }
  out << "*NODE PRINT, NSET=ALL\nU\n*EL PRINT, ELSET=R1\nS\n*EL PRINT, ELSET=R2\nS\n*END STEP\n";
  return out.str();
}

struct CalculixResult {
  Eigen::VectorXd displacement_m;
  std::vector<SymmetricTensor> stress_pa;
  std::size_t nodes = 0, tetrahedra = 0;  // that were found
};

CalculixResult read_calculix(std::istream& in, const TetMesh& mesh) {
  CalculixResult result;
  result.displacement_m = Eigen::VectorXd::Zero(at(mesh.nodes.size()));
  result.stress_pa.assign(mesh.tetrahedra.size(), SymmetricTensor::Zero());
  bool stress = false;
  for (std::string line; std::getline(in, line);) {
    if (line.find("displacements") != std::string::npos) stress = false;
    if (line.find("stresses") != std::string::npos) stress = true;
    std::istringstream words(line);
    std::size_t number = 0;
    if (!(words >> number)) continue;
    if (stress) {
      std::size_t point = 0;
      SymmetricTensor& s = result.stress_pa[number - 1];
      words >> point >> s[0] >> s[1] >> s[2] >> s[3] >> s[5] >> s[4];  // xx yy zz xy xz yz
      ++result.tetrahedra;
    } else {
      for (double& component : result.displacement_m.segment<3>(at(number - 1))) words >> component;
      ++result.nodes;
    }
    EXPECT_FALSE(words.fail()) << line;
  }
  return result;
}

void expect_agreement(TetMesh mesh, testing::Test& test) {
  const Case input = case_of(std::move(mesh));
  const ElasticBody body(input.mesh, input.materials, input.constraints);
  const Eigen::VectorXd force_n = input.force_n + body.weight_n({0, 0, -9.81});
  const Eigen::VectorXd displacement_m = body.solve(force_n).displacement_m;
  const std::vector<SymmetricTensor> stress_pa = body.stress_pa(displacement_m);

  const test::TemporaryFolder folder;
  std::ofstream(folder / "case.inp") << calculix_input(input, force_n);
  const std::string command = "cd '" + folder.path().string() + "' && ccx -i case >log 2>&1 </dev/null";
  ASSERT_EQ(std::system(command.c_str()), 0);
  std::ifstream in(folder / "case.dat");
  const CalculixResult theirs = read_calculix(in, input.mesh);
  const std::vector<bool> used = nodes_in_use(input.mesh);
  ASSERT_EQ(theirs.nodes, static_cast<std::size_t>(std::ranges::count(used, true)));
  ASSERT_EQ(theirs.tetrahedra, input.mesh.tetrahedra.size());

  double largest_m = 0, difference_m = 0, largest_pa = 0, difference_pa = 0;
  for (std::size_t node = 0; node < input.mesh.nodes.size(); ++node) {
    const Vector3 ours_m = displacement_m.segment<3>(at(node)),
                  theirs_m = theirs.displacement_m.segment<3>(at(node));
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
  if (!has_ccx()) GTEST_SKIP() << "ccx is not installed";
  expect_agreement(test::tet_grid({20, 4, 4}, {0.1, 0.02, 0.02}), *this);
}

class CalculixOnRealMeshes : public testing::TestWithParam<const char*> {};

TEST_P(CalculixOnRealMeshes, Agrees) {
  const std::string file = std::string("sim/meshes/") + GetParam();
  KIROKU_NEEDS_SHARED_DATA(file);
  if (!has_ccx()) GTEST_SKIP() << "ccx is not installed";
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

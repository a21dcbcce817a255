// Bodies as CalculiX (ccx) computes them: the same nodes, tetrahedra, prescribed displacements and loads.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sim/fem/elastic_body.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::test {

using sim::Constraints;
using sim::Materials;
using sim::SymmetricTensor;
using sim::TetMesh;
using sim::Vector3;

inline bool has_ccx() { return std::system("ccx -v >/dev/null 2>&1 </dev/null") != 127 << 8; }

/// Text that ccx reads: at most 20 characters.
inline std::string calculix_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.12e", value);
  return text;
}

struct CalculixCase {
  TetMesh mesh;
  Materials materials;
  Constraints constraints{0};
  Eigen::VectorXd force_n;
  std::vector<std::vector<std::uint32_t>> rigid = {};  // nodes that move together as a rigid body
};

inline std::string calculix_input(const CalculixCase& input, const Eigen::VectorXd& force_n) {
  std::ostringstream out;
  out << "*NODE, NSET=ALL\n";
  const std::vector<bool> used = nodes_in_use(input.mesh);
  for (std::size_t node = 0; node < input.mesh.nodes.size(); ++node) {
    const Vector3& position = input.mesh.nodes[node];
    if (used[node]) {
      out << node + 1 << ", " << calculix_number(position.x()) << ", " << calculix_number(position.y())
          << ", " << calculix_number(position.z()) << "\n";
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
        << calculix_number(material.young_modulus_pa) << ", " << calculix_number(material.poisson_ratio)
        << "\n*SOLID SECTION, ELSET=R" << region << ", MATERIAL=M" << region << "\n";
  }
  for (std::size_t i = 0; i < input.rigid.size(); ++i) {
    const std::size_t reference = input.mesh.nodes.size() + 2 * i + 1;
    out << "*NODE\n"
        << reference << ", 0, 0, 0\n"
        << reference + 1 << ", 0, 0, 0\n*NSET, NSET=RIGID" << i << "\n";
    for (const std::uint32_t node : input.rigid[i]) out << node + 1 << ",\n";
    out << "*RIGID BODY, NSET=RIGID" << i << ", REF NODE=" << reference << ", ROT NODE=" << reference + 1
        << "\n";
  }
  out << "*STEP\n*STATIC, SOLVER=SPOOLES\n*BOUNDARY\n";
  for (std::size_t number = 0; number < 3 * input.mesh.nodes.size(); ++number) {
    if (!input.constraints.prescribed(number)) continue;
    const double displacement_m = input.constraints.displacement_m()[static_cast<Eigen::Index>(number)];
    out << number / 3 + 1 << ", " << number % 3 + 1 << ", " << number % 3 + 1 << ", "
        << calculix_number(displacement_m) << "\n";
  }
  out << "*CLOAD\n";
  for (Eigen::Index number = 0; number < force_n.size(); ++number) {
    if (force_n[number] != 0)
      out << number / 3 + 1 << ", " << number % 3 + 1 << ", " << calculix_number(force_n[number]) << "\n";
  }
  out << "*NODE PRINT, NSET=ALL\nU\n*NODE PRINT, NSET=ALL\nRF\n";
  for (const auto& [region, material] : input.materials) out << "*EL PRINT, ELSET=R" << region << "\nS\n";
  out << "*END STEP\n";
  return out.str();
}

struct CalculixResult {
  Eigen::VectorXd displacement_m;
  Eigen::VectorXd reaction_n;  // with the loads at prescribed nodes taken off
  std::vector<SymmetricTensor> stress_pa;
  std::size_t nodes = 0, tetrahedra = 0;  // that were found
};

inline CalculixResult read_calculix(std::istream& in, const TetMesh& mesh) {
  CalculixResult result;
  result.displacement_m = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * mesh.nodes.size()));
  result.stress_pa.assign(mesh.tetrahedra.size(), SymmetricTensor::Zero());
  result.reaction_n = result.displacement_m;
  enum class Section { kDisplacement, kForce, kStress } section = Section::kDisplacement;
  for (std::string line; std::getline(in, line);) {
    if (line.find("displacements") != std::string::npos) section = Section::kDisplacement;
    if (line.find("forces (fx") != std::string::npos) section = Section::kForce;
    if (line.find("stresses") != std::string::npos) section = Section::kStress;
    std::istringstream words(line);
    std::size_t number = 0;
    if (!(words >> number)) continue;
    if (section == Section::kStress) {
      std::size_t point = 0;
      SymmetricTensor& s = result.stress_pa[number - 1];
      words >> point >> s[0] >> s[1] >> s[2] >> s[3] >> s[5] >> s[4];  // xx yy zz xy xz yz
      ++result.tetrahedra;
    } else if (section == Section::kForce) {
      for (double& component : result.reaction_n.segment<3>(static_cast<Eigen::Index>(3 * (number - 1))))
        words >> component;
    } else {
      for (double& component : result.displacement_m.segment<3>(static_cast<Eigen::Index>(3 * (number - 1))))
        words >> component;
      ++result.nodes;
    }
    EXPECT_FALSE(words.fail()) << line;
  }
  return result;
}

/// What ccx answers; a failure of the running test where it does not.
inline CalculixResult run_calculix(const CalculixCase& input, const Eigen::VectorXd& force_n) {
  const TemporaryFolder folder;
  std::ofstream(folder / "case.inp") << calculix_input(input, force_n);
  const std::string command = "cd '" + folder.path().string() + "' && ccx -i case >log 2>&1 </dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0);
  std::ifstream in(folder / "case.dat");
  return read_calculix(in, input.mesh);
}

}  // namespace kiroku::test

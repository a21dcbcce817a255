// A cube of tissue in a CT, and a plan of three steps for it. Header-only.
#pragma once

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

namespace kiroku::test {

/// ct.nrrd, cube.msh and plan.json in `folder`: grasp, lift for a second ("Lift"), hold for a second.
inline void write_cube_plan(const std::filesystem::path& folder) {
  const auto write = [&](const char* name, const std::string& text) {
    std::ofstream(folder / name, std::ios::binary) << text;
  };
  std::string ct =
      "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 20 20 20\n"
      "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (-5,-5,-5)\nencoding: raw\nendian: "
      "little\n\n";
  for (int voxel = 0; voxel < 20 * 20 * 20; ++voxel) {
    const auto value =
        static_cast<std::uint16_t>(60 + std::lround(50 * std::sin(voxel % 20) * std::cos(voxel / 400)));
    ct += static_cast<char>(value & 0xffU);
    ct += static_cast<char>(value >> 8U);
  }
  write("ct.nrrd", ct);
  write("cube.msh",
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n1 0 0 0\n2 10 0 0\n3 0 10 0\n4 10 10 0\n5 0 "
        "0 10\n6 10 0 10\n7 0 10 10\n8 10 10 10\n$EndNodes\n$Elements\n6\n1 4 2 1 1 1 2 4 8\n2 4 2 1 "
        "1 1 3 7 8\n3 4 2 1 1 1 5 6 8\n4 4 2 1 1 1 2 8 6\n5 4 2 1 1 1 5 8 7\n6 4 2 1 1 1 3 8 4\n"
        "$EndElements\n");
  write("plan.json",
        R"({"name": "cube", "volume": "ct.nrrd", "mesh": "cube.msh", "length_unit": "mm", "time_step_s": 0.1,
    "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.45}],
    "fixed": [{"box": [[0, 0, 0], [10, 10, 0]]}],
    "tools": {"forceps": {"kind": "forceps", "jaws": [12, 12, 2]}},
    "steps": [{"do": "grasp", "tool": "forceps", "at": {"position": [5, 5, 10]}},
              {"do": "retract", "name": "Lift", "tool": "forceps", "path": [{"at_s": 1, "position": [6, 5, 12]}]},
              {"do": "hold", "duration_s": 1}]})");
}

}  // namespace kiroku::test

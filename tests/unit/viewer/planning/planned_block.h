// A folder with one plan: a block of 40 x 20 x 20 mm of soft tissue, held at one end, in a CT of its own.
#pragma once

#include <array>
#include <cstdint>
#include <fstream>

#include "sim/mesh/mesh_writer.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tet_grid.h"

namespace kiroku::test {

class PlannedBlock {
 public:
  /// So many cubes along each side are cut into tetrahedra.
  explicit PlannedBlock(const std::array<std::uint32_t, 3>& cubes = {8, 4, 4}) {
    std::filesystem::create_directory(folder_ / "block");
    std::ofstream(folder_ / "block/block.msh")
        << sim::msh_text(tet_grid(cubes, {0.04, 0.02, 0.02}), sim::LengthUnit::kMillimetre);
    std::ofstream ct(folder_ / "block/ct.nrrd");
    ct << "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 26 16 16\n"
          "space directions: (2,0,0) (0,2,0) (0,0,2)\nspace origin: (-5,-5,-5)\nencoding: ascii\n\n";
    for (int voxel = 0; voxel < 26 * 16 * 16; ++voxel) ct << (voxel % 7 == 0 ? 90 : 60) << '\n';
    std::ofstream(folder_ / "block/plan.json") << R"({
      "name": "Block", "volume": "ct.nrrd", "mesh": "block.msh", "length_unit": "mm", "time_step_s": 0.05,
      "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.4}],
      "fixed": [{"box": [[0, 0, 0], [0, 20, 20]]}],
      "tools": {"clamp": {"kind": "forceps", "jaws": [2, 30, 30]}},
      "steps": [{"do": "grasp", "tool": "clamp", "at": {"position": [40, 10, 10]}},
                {"do": "retract", "tool": "clamp", "path": [{"at_s": 0.2, "position": [42, 10, 12]}]}]})";
    std::ofstream(folder_ / "block/other.json") << R"({"no": "plan"})";
  }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_.path(); }

 private:
  TemporaryFolder folder_;
};

}  // namespace kiroku::test

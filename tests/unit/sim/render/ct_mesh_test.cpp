#include "sim/render/ct_mesh.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/mesh/mesh_check.h"
#include "sim/mesh/mesh_topology.h"

namespace kiroku::sim {
namespace {

TEST(CtMesh, FillsTheBoxOfAllVoxelsWhicheverWayTheyRun) {
  Grid grid;
  grid.size = {40, 9, 3};
  grid.spacing_m = {1e-3, 2e-3, 5e-3};
  grid.origin_m = {0.1, -0.2, 0.3};
  for (const double side : {1.0, -1.0}) {
    grid.direction = Vector3(1, 1, side).asDiagonal();
    const TetMesh mesh = mesh_of(grid);
    EXPECT_EQ(mesh.tetrahedra.size(), 6U * 16 * 8 * 2);
    double volume_m3 = 0;
    for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
      EXPECT_GT(signed_volume_m3(mesh, t), 0);
      volume_m3 += signed_volume_m3(mesh, t);
    }
    EXPECT_NEAR(volume_m3, 39e-3 * 16e-3 * 10e-3, 1e-12);
    // Every face lies on the box's surface or between two.
    EXPECT_EQ(faces_of(mesh).surface.size(), 2U * 2 * (16 * 8 + 16 * 2 + 8 * 2));
    EXPECT_TRUE(faces_of(mesh).overcrowded.empty());
  }
}

TEST(CtMesh, RefusesASingleSlice) {
  Grid grid;
  grid.size = {40, 40, 1};
  EXPECT_THROW(mesh_of(grid), Error);
}

}  // namespace
}  // namespace kiroku::sim

#include "sim/render/proxy_geometry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

TEST(ProxyGeometry, GivesBarycentricAndTextureCoordinatesEverywhere) {
  const TetMesh mesh = test::tet_grid({2, 2, 2}, {2, 3, 4});
  // Any affine map of places to the texture is that of each cell.
  std::vector<Vector3> texture, places;
  const auto map = [](const Vector3& p) {
    return Vector3(0.1 * p.x() + 0.2, 0.3 * p.y() - 0.1 * p.z(), 0.05 * p.z());
  };
  for (const Vector3& node : mesh.nodes) {
    places.push_back(node + Vector3(5, -3, -600));
    texture.push_back(map(node));
  }
  std::vector<CellGeometry> cells;
  proxy_geometry(mesh.tetrahedra, places, texture, cells);
  const auto at = [](const std::array<float, 4>& row, const Vector3& p) {
    return double(row[0]) * p.x() + double(row[1]) * p.y() + double(row[2]) * p.z() + double(row[3]);
  };
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (std::size_t corner = 0; corner < 4; ++corner) {
      const Vector3& place = places[mesh.tetrahedra[t][corner]];
      for (std::size_t row = 0; row < 3; ++row) {
        EXPECT_NEAR(at(cells[t].barycentric[row], place), corner == row + 1 ? 1 : 0, 2e-4);
        EXPECT_NEAR(at(cells[t].texture[row], place),
                    texture[mesh.tetrahedra[t][corner]][static_cast<Eigen::Index>(row)], 2e-4);
      }
    }
  }
}

TEST(ProxyGeometry, LinksCellsOverTheirFaces) {
  const TetMesh mesh = test::tet_grid({2, 1, 1}, {2, 1, 1});
  const ProxyTopology topology = proxy_topology(mesh);
  std::size_t open = 0;
  for (std::uint32_t cell = 0; cell < topology.cells.size(); ++cell) {
    for (const std::uint32_t beyond : topology.cells[cell].neighbours) {
      if (beyond == kNoCell) {
        ++open;
      } else {
        EXPECT_THAT(topology.cells[beyond].neighbours, testing::Contains(cell));
      }
    }
  }
  // Each of the box's ten squares is two triangles.
  EXPECT_EQ(open, 20U);
  EXPECT_EQ(topology.surface.size(), 20U);
  for (const EntryFace& face : topology.surface)
    EXPECT_EQ(topology.cells[face.cell_and_corner / 4].neighbours[face.cell_and_corner % 4], kNoCell);
}

}  // namespace
}  // namespace kiroku::sim

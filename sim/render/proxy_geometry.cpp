#include "sim/render/proxy_geometry.h"

#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "base/error.h"

namespace kiroku::sim {
namespace {

std::array<float, 4> single_row(const Eigen::RowVector4d& row) {
  return {static_cast<float>(row[0]), static_cast<float>(row[1]), static_cast<float>(row[2]),
          static_cast<float>(row[3])};
}

}  // namespace

ProxyTopology proxy_topology(const TetMesh& mesh) {
  const Faces faces = faces_of(mesh);
  if (!faces.overcrowded.empty()) {
    throw Error("the mesh cannot be drawn: more than two tetrahedra share the face of nodes " +
                std::to_string(faces.overcrowded[0][0]) + ", " + std::to_string(faces.overcrowded[0][1]) +
                " and " + std::to_string(faces.overcrowded[0][2]) + "; mend it in the program that made it");
  }
  const Neighbours neighbours = neighbours_of(mesh, faces);
  ProxyTopology topology;
  topology.cells.resize(mesh.tetrahedra.size());
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (std::size_t corner = 0; corner < 4; ++corner) {
      const std::uint32_t beyond = neighbours[t][corner];
      topology.cells[t].neighbours[corner] = beyond == t ? kNoCell : beyond;
      topology.cells[t].nodes[corner] = mesh.tetrahedra[t][corner];
      if (beyond != t) continue;
      const std::array<std::size_t, 3>& face = kFaceCorners[corner];
      topology.surface.push_back(
          {{mesh.tetrahedra[t][face[0]], mesh.tetrahedra[t][face[1]], mesh.tetrahedra[t][face[2]]},
           4 * t + static_cast<std::uint32_t>(corner)});
    }
  }
  return topology;
}

void proxy_geometry(std::span<const Tetrahedron> tetrahedra, std::span<const Vector3> positions_mm,
                    std::span<const Vector3> texture, std::vector<CellGeometry>& cells) {
  cells.resize(tetrahedra.size());
  for (std::size_t t = 0; t < tetrahedra.size(); ++t) {
    const auto& [a, b, c, d] = tetrahedra[t];
    const Vector3& origin = positions_mm[a];
    Eigen::Matrix3d edges, texture_edges;
    edges << positions_mm[b] - origin, positions_mm[c] - origin, positions_mm[d] - origin;
    texture_edges << texture[b] - texture[a], texture[c] - texture[a], texture[d] - texture[a];
    CellGeometry& cell = cells[t];
    const Eigen::Matrix3d inverse = edges.inverse();
    if (!inverse.allFinite()) {
      cell = {};
      continue;
    }
    Eigen::Matrix<double, 3, 4> barycentric, coordinates;
    barycentric << inverse, -inverse * origin;
    coordinates = texture_edges * barycentric;
    coordinates.col(3) += texture[a];
    for (std::size_t row = 0; row < 3; ++row) {
      cell.barycentric[row] = single_row(barycentric.row(static_cast<Eigen::Index>(row)));
      cell.texture[row] = single_row(coordinates.row(static_cast<Eigen::Index>(row)));
    }
  }
}

}  // namespace kiroku::sim

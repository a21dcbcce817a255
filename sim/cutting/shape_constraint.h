// Where the nodes of a body may go without changing its shape. Immutable, thread-safe.
//
// The shape is the body's surface and the faces between regions, as they were before any cut. A node inside
// goes anywhere. A node of a face stays on the faces that were around it; where they meet at an edge sharper
// than kFeatureAngle, on that line; where more than two such edges meet, or two that form a corner, where it
// was.
#pragma once

#include <cstdint>
#include <vector>

#include "sim/mesh/mesh_topology.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

enum class NodeKind : std::uint8_t { kInner, kFace, kLine, kCorner };

class ShapeConstraint {
 public:
  /// Between the normals of two faces, and between one edge of a line and the continuation of the other.
  static constexpr double kFeatureAngleDegrees = 40;

  ShapeConstraint(const TetMesh& mesh, const Faces& faces);

  [[nodiscard]] NodeKind kind(std::uint32_t node) const { return kind_[node]; }
  /// The place nearest to `point` where the node may go.
  [[nodiscard]] Vector3 nearest(std::uint32_t node, const Vector3& point) const;

 private:
  void find_features(const std::vector<std::array<std::uint32_t, 2>>& features);

  std::vector<Vector3> nodes_;                           // before any cut
  std::vector<std::array<std::uint32_t, 3>> triangles_;  // of the shape
  std::vector<std::size_t> begin_;                       // (|V| + 1), into around_
  std::vector<std::uint32_t> around_;                    // triangles around each node
  std::vector<NodeKind> kind_;                           // (|V|)
  std::vector<std::array<std::uint32_t, 2>> line_;       // (|V|): for kLine, the line's nodes beside this one
};

}  // namespace kiroku::sim

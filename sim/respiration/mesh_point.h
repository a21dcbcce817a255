// Places in a mesh that go with it. Pure functions, thread-safe.
#pragma once

#include <array>
#include <map>
#include <vector>

#include <Eigen/Core>

#include "sim/mesh/tet_mesh.h"
#include "sim/volume/grid.h"

namespace kiroku::sim {

/// A place in a mesh, as a mean of nodes: what the mesh's displacement moves it by is the mean of theirs.
struct MeshPoint {
  std::vector<std::uint32_t> nodes;
  std::vector<double> weights;  // add up to 1
  [[nodiscard]] Vector3 mean(const std::vector<Vector3>& of_nodes) const;
  /// Of vectors of (3 |V|).
  [[nodiscard]] Vector3 mean(const Eigen::VectorXd& of_nodes) const;
};

/// A point by the corners of the element that it is in, or of the one it is nearest to (then one weight at
/// least is negative, and the element's motion is carried on).
struct LocatedPoint {
  MeshPoint point;
  std::uint32_t tetrahedron = 0;
  double outside_m = 0;  // about how far from that element; 0 inside
};

/// Finds points in a mesh, fast where there are many. Immutable, thread-safe; the mesh must outlive it.
class MeshLocator {
 public:
  /// Of a mesh whose elements have a volume.
  explicit MeshLocator(const TetMesh& mesh);
  /// Of elements that share the point, the first.
  [[nodiscard]] LocatedPoint locate(const Vector3& place_m) const;

 private:
  using Cell = std::array<long, 3>;
  [[nodiscard]] Cell cell_of(const Vector3& place_m) const;
  [[nodiscard]] Eigen::Vector4d weights_at(std::uint32_t tetrahedron, const Vector3& place_m) const;
  [[nodiscard]] LocatedPoint located(std::uint32_t tetrahedron, const Eigen::Vector4d& weights,
                                     double outside_m) const;

  const TetMesh& mesh_;
  std::vector<Eigen::Matrix3d> to_weights_;  // (|T|)
  double cell_m_ = 1;
  std::map<Cell, std::vector<std::uint32_t>> elements_in_;  // whose boxes reach into it, ascending
};

/// Marks voxels whose centre is in one of these tetrahedra, with nodes at `positions_m` (|V|); `marked`
/// (grid.voxels()). What lies beside the grid is left out.
void mark_voxels(const std::vector<Vector3>& positions_m, const std::vector<Tetrahedron>& tetrahedra,
                 const Grid& grid, std::vector<std::uint8_t>& marked);

}  // namespace kiroku::sim

// How the neighbourhood of each node has turned, to turn gradients with it.
//
// Source: section 3 of "Interactive Volume Manipulation for Supporting Preoperative Planning": an
// orthonormal basis at each vertex from where its neighbours were and are. Here, with X and x the edges to
// the neighbours before and after, F = (sum x X^T) (sum X X^T)^-1 is the deformation that fits them best
// (least squares), and its polar decomposition F = R S gives the rotation.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// Of one mesh. Immutable; thread-safe.
class VertexRotations {
 public:
  /// Copies what it needs.
  explicit VertexRotations(const TetMesh& rest);

  /// One for each node, of length 1; the identity for loose nodes. `positions_m`: (|V|), where the nodes are
  /// now. A neighbourhood that is turned inside out gets the nearest rotation.
  void compute(std::span<const Vector3> positions_m, std::vector<Eigen::Quaterniond>& rotations) const;

 private:
  std::vector<Vector3> rest_m_;
  std::vector<std::size_t> begin_;         // (|V| + 1)
  std::vector<std::uint32_t> neighbours_;  // ascending for each node
  std::vector<Eigen::Matrix3d> inverse_;   // (|V|), of sum X X^T; zero where the neighbours lie in a plane
};

}  // namespace kiroku::sim

// A body cut open along a plane, so that a picture shows what is inside. Nothing is simulated with it. Pure,
// thread-safe.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::trainer {

/// What is left. Each of its nodes lies on an edge of the whole body (or on a node: both ends are the same).
struct OpenedObject {
  sim::TetMesh mesh;                               // (|V'|), (|T'|), regions as those of the whole
  std::vector<std::array<std::uint32_t, 2>> ends;  // (|V'|): nodes of the whole
  std::vector<double> shares;                      // (|V'|): 0 at the first end, 1 at the second

  /// A number of each of the whole body's nodes (|V|), at the nodes of what is left (|V'|): linear on edges.
  [[nodiscard]] std::vector<double> numbers(const std::vector<double>& of_whole) const;
  /// The same of displacements: (3 |V|) gives (3 |V'|).
  [[nodiscard]] Eigen::VectorXd displacement_m(const Eigen::VectorXd& of_whole_m) const;
};

/// Keeps what lies on the side of the plane through `on_plane_m` that `away` (not zero) points away from.
/// Tetrahedra that the plane goes through are cut along it: their faces on it are flat. Volumes stay
/// positive.
OpenedObject open_object(const sim::TetMesh& mesh, const sim::Vector3& on_plane_m, const sim::Vector3& away);

}  // namespace kiroku::trainer

// The three ways to cut a tetrahedral mesh that vertex-preserving cutting is compared with, and what they are
// measured by. Each is as simple as the papers that brought it describe it: nothing is snapped, merged or
// smoothed afterwards. A blade's path is flat here. Lengths in m. Not thread-safe; functions are pure.
//
// Source of the comparison: Figure 2 of "Interactive Volume Manipulation for Supporting Preoperative
// Planning".
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <set>
#include <utility>
#include <vector>

#include "sim/cutting/sweep_surface.h"
#include "sim/fem/constraints.h"
#include "sim/fem/elastic_body.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::test {

/// Tetrahedra that have an edge the blade goes through are taken out; nothing else changes.
class RemovingCut {
 public:
  explicit RemovingCut(sim::TetMesh mesh);

  /// The tetrahedra that have gone, ascending.
  std::vector<std::uint32_t> cut(const sim::SweepSurface& sweep);

  [[nodiscard]] bool present(std::uint32_t tetrahedron) const { return present_[tetrahedron] != 0; }
  /// Nodes keep their numbers.
  [[nodiscard]] sim::TetMesh mesh() const;

 private:
  sim::TetMesh mesh_;
  std::vector<std::uint8_t> present_;  // (|T|)
};

/// A mesh whose nodes are given to each side of faces that have been opened.
class PartingMesh {
 public:
  explicit PartingMesh(sim::TetMesh mesh);

  /// Nodes that were there keep their numbers; those that came follow.
  [[nodiscard]] const sim::TetMesh& mesh() const { return mesh_; }

 protected:
  [[nodiscard]] const std::vector<std::uint32_t>& around(std::uint32_t node) const { return around_[node]; }
  std::uint32_t add_node(const sim::Vector3& position_m);
  /// Puts `node` onto the edge from `a` to `b`: each tetrahedron around the edge becomes two.
  void bisect(std::uint32_t a, std::uint32_t b, std::uint32_t node);
  /// Tetrahedra around the node hang together where they share a face at it that `opened(t, u)` leaves. Where
  /// they are several groups, each but the first gets a node of its own; returns those.
  template <typename Opened>
  std::vector<std::uint32_t> part(std::uint32_t node, Opened opened);
  [[nodiscard]] std::vector<std::uint32_t> shared(std::uint32_t t, std::uint32_t u) const;

 private:
  sim::TetMesh mesh_;
  std::vector<std::vector<std::uint32_t>> around_;  // (|V|)
};

/// Edges that the blade goes through get a node there; what these divide the tetrahedra into lies on one side
/// of the blade each, and the faces between the sides are opened.
class SubdividingCut : public PartingMesh {
 public:
  explicit SubdividingCut(sim::TetMesh mesh);
  void cut(const sim::SweepSurface& sweep);

 private:
  std::vector<std::uint8_t> on_blade_;  // (|V|)
};

/// Tetrahedra stay as they are: a face is opened where the line from the centre of the one beside it to that
/// of the other goes through the blade.
class FaceSplittingCut : public PartingMesh {
 public:
  explicit FaceSplittingCut(sim::TetMesh mesh);
  void cut(const sim::SweepSurface& sweep);
  /// Opens the inner faces that `chosen` says, by their corners.
  void open(const std::function<bool(const std::array<sim::Vector3, 3>&)>& chosen);

 private:
  void open(const std::vector<std::array<std::uint32_t, 2>>& faces);

  std::vector<std::array<std::uint32_t, 2>> between_;  // the two tetrahedra of each inner face
  std::vector<sim::Vector3> centre_;                   // (|T|)
  std::set<std::pair<std::uint32_t, std::uint32_t>> opened_;
};

double volume_m3(const sim::TetMesh& mesh);

/// Between two faces of one tetrahedron; 70.5 for a regular one.
double smallest_dihedral_degrees(const sim::TetMesh& mesh);

/// Of tetrahedra that hang together by faces the most; nodes keep their numbers.
sim::TetMesh largest_part(const sim::TetMesh& mesh);

/// The largest eigenvalue of the stiffness matrix among its unknowns over the smallest, estimated by power
/// and inverse iteration from below.
double condition_number(const sim::ElasticBody& body);

}  // namespace kiroku::test

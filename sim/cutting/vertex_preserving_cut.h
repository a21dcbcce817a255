// Cutting a body without adding a vertex: the tetrahedra that a blade goes through are taken out, and their
// nodes move onto the surface it swept, so that the gap closes and the two faces of the cut lie on it.
//
// Source: vertex-preserving cutting, "Interactive Volume Manipulation for Supporting Preoperative Planning".
// What is cut is the rest shape; RestMapping brings a blade that was moved through a deformed body there.
//
// One step, S the surface swept:
//  1. A tetrahedron goes when S goes through one of its edges. So every edge that S meets is parted; where S
//     only reaches into a tetrahedron without meeting an edge, nothing happens.
//  2. A node at the end of such an edge belongs to the side of S it is on. One that would be left with no
//     tetrahedron (a sliver thinner than the elements) goes over to the other side where that keeps some, and
//     these stay.
//  3. Where that leaves tetrahedra around a node or an edge in groups that share no face there, only the
//     largest stays: the surface stays one that has two faces at each edge and one fan around each node.
//  4. What is left with all four nodes pressed onto S would be flat: it goes too, where 3 stays true.
//  5. Each of these nodes moves by dv = {n (v - p)} n onto S, one whose foot is beside S onto its border, to
//     kClearance on its own side. Nodes of the surface and of faces between regions slide along them
//     (ShapeConstraint); nodes of an earlier cut that runs another way stay in its plane. Nodes on both sides
//     of the plane of S that lost an edge between them before the blade came to it move when it does.
//  6. The rule that keeps every volume positive: a move is shortened (by eighths, at worst to none) until no
//     tetrahedron around the node has a lower quality than the lesser of kLeastQuality and what it had, and
//     no further edge goes through S. So no sequence of cuts ever brings the quality of any element below the
//     lesser of kLeastQuality and what it was at the beginning. Where moves are shortened the gap stays open
//     a little (volume_lost_m3 says it); they are tried again once a later step has made room.
//
// The work of a step grows with what it touches, but for one quick pass over all tetrahedra; it does not grow
// with the steps before. The same mesh and the same steps give the same bits.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "sim/cutting/shape_constraint.h"
#include "sim/cutting/sweep_surface.h"
#include "sim/mesh/mesh_change.h"
#include "sim/mesh/mesh_topology.h"

namespace kiroku::sim {

/// What a step did.
struct CutStep {
  MeshChange change;
  double volume_lost_m3 = 0;  // of the body, before less after; may be a little below 0 where nodes slid over
                              // an edge of the surface
  std::vector<Face> opened;   // faces of tetrahedra that are left, which have lost their neighbour
  std::size_t shortened = 0;  // moves that were shortened so that no element was spoilt
  std::size_t left_alone = 0;  // nodes that lost their last tetrahedron
};

/// A body that is cut again and again. Nodes and tetrahedra keep their numbers. Not thread-safe.
class VertexPreservingCut {
 public:
  /// 6 sqrt(2) V / l^3, l the root mean square of the edges: 1 for a regular tetrahedron, 0 for a flat one.
  static constexpr double kLeastQuality = 0.1;
  /// How far from S a face of the cut comes to lie, of the mean edge: S stays between the two faces for
  /// certain, and the same cut again finds nothing left to part.
  static constexpr double kClearance = 1e-3;

  /// kiroku::Error for a mesh that nothing can be computed with (check_for_solving()).
  explicit VertexPreservingCut(TetMesh mesh);

  CutStep cut(const SweepSurface& sweep);

  /// All nodes where they are now; all tetrahedra, those that are no longer there too.
  [[nodiscard]] const TetMesh& mesh() const { return mesh_; }
  [[nodiscard]] bool present(std::uint32_t tetrahedron) const { return present_[tetrahedron] != 0; }
  /// The mesh without the tetrahedra that are gone, the others in their order; nodes keep their numbers.
  [[nodiscard]] TetMesh remaining() const;
  /// Faces of tetrahedra that are present which no present tetrahedron shares; in the order of these.
  [[nodiscard]] std::vector<Face> surface() const;
  /// What hangs together by whole faces, numbered in the order of the first tetrahedron; kGone for those that
  /// are gone.
  [[nodiscard]] Parts parts() const;
  static constexpr std::uint32_t kGone = 0xFFFFFFFF;

 private:
  struct Step;
  struct Plane {
    Vector3 point, normal;
  };
  /// A node that is to come to the path's sweeps and has not yet.
  struct Unfinished {
    std::shared_ptr<const SweepSurface> sweep;  // of the path so far, the nearest
    int side;
    bool ahead;  // it lost its edges through the sweep's plane before the blade came to them
  };

  [[nodiscard]] std::span<const std::uint32_t> around(std::uint32_t node) const {
    return std::span(around_).subspan(begin_[node], begin_[node + 1] - begin_[node]);
  }
  [[nodiscard]] double quality(std::uint32_t tetrahedron) const;

  VertexPreservingCut(const Faces& faces, TetMesh&& mesh);
  [[nodiscard]] Face face(std::uint32_t tetrahedron, std::size_t opposite) const;
  void find_crossings(Step& step) const;
  void take_sides(Step& step) const;
  void remove(std::uint32_t tetrahedron, Step& step);
  [[nodiscard]] std::vector<std::vector<std::uint32_t>> groups_of(std::uint32_t one,
                                                                  std::uint32_t other) const;
  void remove_hinge(std::uint32_t one, std::uint32_t other, Step& step);
  void remove_hinges(Step& step);
  void find_targets(Step& step);
  void note_ahead(const Step& step);
  void remove_pressed(Step& step);
  [[nodiscard]] std::size_t crossing_around(std::uint32_t node, const SweepSurface& sweep) const;
  void move_nodes(Step& step);
  [[nodiscard]] Vector3 target(std::uint32_t node, int side, const SweepSurface& sweep) const;

  TetMesh mesh_;
  Neighbours neighbours_;
  ShapeConstraint shape_;
  double clearance_m_ = 0;
  std::vector<std::uint8_t> present_;           // (|T|)
  std::vector<std::size_t> begin_;              // (|V| + 1), into around_
  std::vector<std::uint32_t> around_;           // tetrahedra around each node, ascending
  std::vector<std::vector<Plane>> cut_planes_;  // (|V|): of the cuts each node lies on, one a direction
  std::map<std::uint32_t, Unfinished> unfinished_;
  BladePose last_edge_;  // a sweep that begins with it goes on with the path; another begins one
};

}  // namespace kiroku::sim

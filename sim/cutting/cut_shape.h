// The shape of a body that is cut, and what of it still bears. Not thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sim/cutting/vertex_preserving_cut.h"
#include "sim/fem/constraints.h"

namespace kiroku::sim {

/// A part with no way over whole faces to what holds it still cannot be solved for: it has fallen off and
/// bears nothing any longer, cut again or not.
class CutShape {
 public:
  /// kiroku::Error as VertexPreservingCut throws it.
  CutShape(const TetMesh& mesh, Constraints constraints);

  struct Step {
    CutStep cut;
    std::vector<std::uint32_t> adrift;  // tetrahedra that are there and bear no longer since this step
    /// Each part that has fallen off in this step: "a part of 12 tetrahedra with node 7 hangs on nothing that
    /// is fixed any longer: it is held where it was".
    std::vector<std::string> fallen;
    [[nodiscard]] bool changed() const { return !cut.change.removed.empty() || !cut.change.moved.empty(); }
  };
  /// kiroku::Error where nothing that is left is held; the shape is of no use then.
  Step cut(const SweepSurface& sweep);

  [[nodiscard]] const VertexPreservingCut& geometry() const { return geometry_; }
  /// Whether a tetrahedron is there and hangs on something that is held.
  [[nodiscard]] bool bears(std::uint32_t tetrahedron) const {
    return geometry_.present(tetrahedron) && adrift_[tetrahedron] == 0;
  }
  /// The mesh of those, in their order; nodes keep their numbers.
  [[nodiscard]] TetMesh bearing() const;

 private:
  void find_adrift(Step& step);

  Constraints constraints_;
  VertexPreservingCut geometry_;
  std::vector<std::uint8_t> adrift_;  // (|T|)
};

}  // namespace kiroku::sim

// An elastic body that is cut, step after step: its shape, its matrix and its factor kept together. Not
// thread-safe.
//
// The matrix keeps its size and pattern: blocks of elements that go become zero. Blocks that change are
// summed anew from the elements that are left rather than subtracted from, so that after any number of steps
// the matrix and its factor have the bits of fresh ones.
//
// What falls off. A part with no way over whole faces to what holds it still cannot be solved for. It stays
// where it was: its tetrahedra bear nothing any longer, nodes that belong to no held part do not move, and
// the step says so in words. A node that has lost its last tetrahedron stays where it was too.
#pragma once

#include <string>
#include <vector>

#include "sim/cutting/vertex_preserving_cut.h"
#include "sim/fem/elastic_body.h"

namespace kiroku::sim {

class CutBody {
 public:
  /// kiroku::Error as ElasticBody throws it.
  CutBody(const TetMesh& mesh, const Materials& materials, const Constraints& constraints);

  struct Step {
    CutStep cut;
    /// Each part that has fallen off in this step: "a part of 12 tetrahedra with node 7 hangs on nothing that
    /// is fixed any longer: it is held where it was".
    std::vector<std::string> fallen;
  };
  /// kiroku::Error where nothing that is left is held; the body is of no use then.
  Step cut(const SweepSurface& sweep);

  /// As ElasticBody::solve().
  [[nodiscard]] StaticSolution solve(const Eigen::VectorXd& force_n) const { return body_.solve(force_n); }
  [[nodiscard]] const ElasticBody& body() const { return body_; }
  [[nodiscard]] const VertexPreservingCut& shape() const { return shape_; }
  /// Whether a tetrahedron is there and hangs on something that is held.
  [[nodiscard]] bool bears(std::uint32_t tetrahedron) const {
    return shape_.present(tetrahedron) && adrift_[tetrahedron] == 0;
  }

 private:
  std::vector<std::uint32_t> find_adrift(std::vector<std::string>& sentences);

  Constraints constraints_;
  VertexPreservingCut shape_;
  ElasticBody body_;
  std::vector<std::uint8_t> adrift_;  // (|T|)
};

}  // namespace kiroku::sim

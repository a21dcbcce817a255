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

#include "sim/cutting/cut_shape.h"
#include "sim/fem/elastic_body.h"

namespace kiroku::sim {

class CutBody {
 public:
  /// kiroku::Error as ElasticBody throws it.
  CutBody(const TetMesh& mesh, const Materials& materials, const Constraints& constraints);

  /// kiroku::Error where nothing that is left is held; the body is of no use then.
  CutShape::Step cut(const SweepSurface& sweep);

  /// As ElasticBody::solve().
  [[nodiscard]] StaticSolution solve(const Eigen::VectorXd& force_n) const { return body_.solve(force_n); }
  [[nodiscard]] const ElasticBody& body() const { return body_; }
  [[nodiscard]] const VertexPreservingCut& shape() const { return shape_.geometry(); }
  [[nodiscard]] bool bears(std::uint32_t tetrahedron) const { return shape_.bears(tetrahedron); }

 private:
  CutShape shape_;
  ElasticBody body_;
};

}  // namespace kiroku::sim

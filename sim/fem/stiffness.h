// The stiffness matrix of a body: sparse, symmetric, in blocks of 3 by 3 (one for each pair of nodes of an
// element). Not thread-safe while it is updated.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "sim/fem/material.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// Where the unknowns of a system are counted: what marks components that are none.
inline constexpr std::uint32_t kNoUnknown = 0xFFFFFFFF;

class StiffnessMatrix {
 public:
  /// `materials` (|T|) is each tetrahedron's. Elements are added in their order, so that the same mesh gives
  /// the same bits. With `axes` (|V|, as Constraints has them; else empty) rows and columns of a node are
  /// along its own axes: R^T K R.
  StiffnessMatrix(const TetMesh& mesh, std::span<const Material* const> materials,
                  std::vector<Eigen::Matrix3d> axes = {});
  /// From other elements than linear ones; `element_matrix` is asked for each tetrahedron in turn.
  StiffnessMatrix(const TetMesh& mesh,
                  const std::function<Eigen::Matrix<double, 12, 12>(std::size_t)>& element_matrix);

  /// Brings the blocks between these nodes up to date with the mesh, whose tetrahedra and `materials` keep
  /// their numbers; only those that `bears` (|T|) names count. The blocks are summed anew in the same order,
  /// so that any sequence of updates gives the bits of a new matrix. A node that no tetrahedron bears any
  /// longer keeps a third of the trace of its block, so that the matrix stays positive definite.
  void update(const TetMesh& mesh, std::span<const Material* const> materials, const std::vector<bool>& bears,
              std::span<const std::uint32_t> nodes);

  [[nodiscard]] std::size_t nodes() const { return begin_.size() - 1; }
  /// K u; (3 |V|), N for m, both along the nodes' own axes.
  [[nodiscard]] Eigen::VectorXd operator*(const Eigen::VectorXd& displacement_m) const;

  /// The block column of a node: the nodes of its rows, ascending from itself (only this triangle is kept)
  /// ...
  [[nodiscard]] std::span<const std::uint32_t> rows(std::size_t node) const {
    return std::span(rows_).subspan(begin_[node], begin_[node + 1] - begin_[node]);
  }
  /// ... and their blocks.
  [[nodiscard]] std::span<const Eigen::Matrix3d> blocks(std::size_t node) const {
    return std::span(blocks_).subspan(begin_[node], begin_[node + 1] - begin_[node]);
  }

 private:
  /// All blocks zero.
  explicit StiffnessMatrix(const TetMesh& mesh);
  template <typename BlockOf, typename Counts>
  void add(const Tetrahedron& tetrahedron, BlockOf block_of, Counts counts);
  [[nodiscard]] std::size_t block_at(std::uint32_t row, std::uint32_t column) const;

  std::vector<std::size_t> begin_;  // (|V| + 1)
  std::vector<std::uint32_t> rows_;
  std::vector<Eigen::Matrix3d> blocks_;
  std::vector<Eigen::Matrix3d> axes_;  // (|V|), or empty
};

}  // namespace kiroku::sim

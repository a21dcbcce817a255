// The stiffness matrix of a body: sparse, symmetric, in blocks of 3 by 3 (one for each pair of nodes of an
// element). Immutable; thread-safe.
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
  /// the same bits.
  StiffnessMatrix(const TetMesh& mesh, std::span<const Material* const> materials);
  /// From other elements than linear ones; `element_matrix` is asked for each tetrahedron in turn.
  StiffnessMatrix(const TetMesh& mesh,
                  const std::function<Eigen::Matrix<double, 12, 12>(std::size_t)>& element_matrix);

  [[nodiscard]] std::size_t nodes() const { return begin_.size() - 1; }
  /// K u; (3 |V|), N for m.
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
  template <typename BlockOf>
  void add(const Tetrahedron& tetrahedron, BlockOf block_of);
  [[nodiscard]] std::size_t block_at(std::uint32_t row, std::uint32_t column) const;

  std::vector<std::size_t> begin_;  // (|V| + 1)
  std::vector<std::uint32_t> rows_;
  std::vector<Eigen::Matrix3d> blocks_;
};

}  // namespace kiroku::sim

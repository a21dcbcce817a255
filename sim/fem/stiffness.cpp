#include "sim/fem/stiffness.h"

#include <algorithm>
#include <utility>

#include "sim/fem/element.h"
#include "sim/mesh/node_graph.h"

namespace kiroku::sim {
namespace {

auto linear_blocks(const TetMesh& mesh, std::size_t tetrahedron, const Material& material) {
  return [element = element_of(mesh, tetrahedron), &material](Eigen::Index a, Eigen::Index b) {
    return stiffness_block(element, material, a, b);
  };
}

}  // namespace

StiffnessMatrix::StiffnessMatrix(const TetMesh& mesh) {
  NodeGraph graph = node_graph_of(mesh);
  begin_ = std::move(graph.begin);
  rows_ = std::move(graph.rows);
  blocks_.assign(rows_.size(), Eigen::Matrix3d::Zero());
}

/// Blocks of an element between nodes that count.
template <typename BlockOf, typename Counts>
void StiffnessMatrix::add(const Tetrahedron& tetrahedron, BlockOf block_of, Counts counts) {
  for (std::size_t a = 0; a < 4; ++a) {
    for (std::size_t b = 0; b < 4; ++b) {
      const std::uint32_t row = tetrahedron[a], column = tetrahedron[b];
      if (row < column || !counts(row) || !counts(column)) continue;
      const Eigen::Matrix3d block = block_of(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
      blocks_[block_at(row, column)] +=
          axes_.empty() ? block : (axes_[row].transpose() * block * axes_[column]).eval();
    }
  }
}

StiffnessMatrix::StiffnessMatrix(const TetMesh& mesh, std::span<const Material* const> materials,
                                 std::vector<Eigen::Matrix3d> axes)
    : StiffnessMatrix(mesh) {
  axes_ = std::move(axes);
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t)
    add(mesh.tetrahedra[t], linear_blocks(mesh, t, *materials[t]), [](std::uint32_t) { return true; });
}

StiffnessMatrix::StiffnessMatrix(
    const TetMesh& mesh, const std::function<Eigen::Matrix<double, 12, 12>(std::size_t)>& element_matrix)
    : StiffnessMatrix(mesh) {
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    const Eigen::Matrix<double, 12, 12> matrix = element_matrix(t);
    add(
        mesh.tetrahedra[t],
        [&](Eigen::Index a, Eigen::Index b) -> Eigen::Matrix3d { return matrix.block<3, 3>(3 * a, 3 * b); },
        [](std::uint32_t) { return true; });
  }
}

void StiffnessMatrix::update(const TetMesh& mesh, std::span<const Material* const> materials,
                             const std::vector<bool>& bears, std::span<const std::uint32_t> nodes) {
  std::vector<std::uint8_t> touched(this->nodes());
  for (const std::uint32_t node : nodes) touched[node] = 1;
  const auto counts = [&](std::uint32_t node) { return touched[node] != 0; };
  std::vector<double> mean(nodes.size());  // of the diagonal, before
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const auto column_rows = rows(nodes[i]);
    if (column_rows.empty()) continue;
    mean[i] = blocks_[begin_[nodes[i]]].trace() / 3;  // the first row is the node's own
    for (std::size_t row = 0; row < column_rows.size(); ++row) {
      if (counts(column_rows[row])) blocks_[begin_[nodes[i]] + row].setZero();
    }
  }
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    if (bears[t] && std::ranges::any_of(mesh.tetrahedra[t], counts))
      add(mesh.tetrahedra[t], linear_blocks(mesh, t, *materials[t]), counts);
  }
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (rows(nodes[i]).empty()) continue;
    Eigen::Matrix3d& own = blocks_[begin_[nodes[i]]];
    if (own.isZero(0)) own.diagonal().setConstant(mean[i]);
  }
}

std::size_t StiffnessMatrix::block_at(std::uint32_t row, std::uint32_t column) const {
  const auto column_rows = rows(column);
  return begin_[column] +
         static_cast<std::size_t>(std::ranges::lower_bound(column_rows, row) - column_rows.begin());
}

Eigen::VectorXd StiffnessMatrix::operator*(const Eigen::VectorXd& displacement_m) const {
  Eigen::VectorXd force_n = Eigen::VectorXd::Zero(displacement_m.size());
  for (std::size_t column = 0; column < nodes(); ++column) {
    const auto at_column = static_cast<Eigen::Index>(3 * column);
    const Eigen::Vector3d moved_m = displacement_m.segment<3>(at_column);
    Eigen::Vector3d at_column_n = Eigen::Vector3d::Zero();
    for (std::size_t i = begin_[column]; i < begin_[column + 1]; ++i) {
      const auto at_row = static_cast<Eigen::Index>(3 * std::size_t{rows_[i]});
      force_n.segment<3>(at_row) += blocks_[i] * moved_m;
      if (at_row != at_column) at_column_n += blocks_[i].transpose() * displacement_m.segment<3>(at_row);
    }
    force_n.segment<3>(at_column) += at_column_n;
  }
  return force_n;
}

}  // namespace kiroku::sim

#include "sim/fem/stiffness.h"

#include <algorithm>

#include "sim/fem/element.h"

namespace kiroku::sim {

StiffnessMatrix::StiffnessMatrix(const TetMesh& mesh, std::span<const Material* const> materials) {
  // The pattern: for each node its elements, then the nodes of these that are not before it.
  std::vector<std::size_t> element_begin(mesh.nodes.size() + 1);
  for (const Tetrahedron& corners : mesh.tetrahedra) {
    for (const std::uint32_t node : corners) ++element_begin[node + 1];
  }
  for (std::size_t node = 1; node < element_begin.size(); ++node)
    element_begin[node] += element_begin[node - 1];
  std::vector<std::uint32_t> elements(4 * mesh.tetrahedra.size());
  std::vector<std::size_t> next(element_begin.begin(), element_begin.end() - 1);
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (const std::uint32_t node : mesh.tetrahedra[t]) elements[next[node]++] = t;
  }
  begin_.reserve(mesh.nodes.size() + 1);
  begin_.push_back(0);
  std::vector<std::uint32_t> last_seen_from(mesh.nodes.size(), static_cast<std::uint32_t>(mesh.nodes.size()));
  for (std::uint32_t node = 0; node < mesh.nodes.size(); ++node) {
    for (std::size_t i = element_begin[node]; i < element_begin[node + 1]; ++i) {
      for (const std::uint32_t other : mesh.tetrahedra[elements[i]]) {
        if (other < node || last_seen_from[other] == node) continue;
        last_seen_from[other] = node;
        rows_.push_back(other);
      }
    }
    std::sort(rows_.begin() + static_cast<std::ptrdiff_t>(begin_.back()), rows_.end());
    begin_.push_back(rows_.size());
  }
  blocks_.assign(rows_.size(), Eigen::Matrix3d::Zero());
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    const LinearElement element = element_of(mesh, t);
    for (std::size_t a = 0; a < 4; ++a) {
      for (std::size_t b = 0; b < 4; ++b) {
        const std::uint32_t row = mesh.tetrahedra[t][a], column = mesh.tetrahedra[t][b];
        if (row < column) continue;
        blocks_[block_at(row, column)] += stiffness_block(
            element, *materials[t], static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
      }
    }
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

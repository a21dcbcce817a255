// Which displacements of a body are prescribed. Not thread-safe while it is changed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace kiroku::sim {

/// Component `c` (0 to 2: x, y, z) of node `n` has the number 3 n + c, as in all vectors of (3 |V|). A node
/// that slides along a line or a surface is given axes of its own: its components are then those along them.
class Constraints {
 public:
  explicit Constraints(std::size_t nodes);

  /// From now on the node's components are along the columns of `axes`, a rotation. kiroku::Error where
  /// something of the node is prescribed already, or `axes` is none.
  void turn(std::size_t node, const Eigen::Matrix3d& axes);
  /// Whether any node has axes of its own.
  [[nodiscard]] bool turned() const { return !axes_.empty(); }
  /// (|V|), identity for nodes with the mesh's axes; empty where no node is turned.
  [[nodiscard]] const std::vector<Eigen::Matrix3d>& axes() const { return axes_; }
  /// Vectors of (3 |V|) from the mesh's axes to each node's own, and back.
  [[nodiscard]] Eigen::VectorXd to_own_axes(Eigen::VectorXd vectors) const;
  [[nodiscard]] Eigen::VectorXd from_own_axes(Eigen::VectorXd vectors) const;

  /// `source` says who asks ("fixed[1]"). The same again is welcome; another displacement of the same
  /// component is refused in a kiroku::Error that names both sources, the node and both displacements.
  void prescribe(std::size_t node, std::size_t component, double displacement_m, const std::string& source);
  /// All three components.
  void prescribe(std::size_t node, const Eigen::Vector3d& displacement_m, const std::string& source);

  [[nodiscard]] bool prescribed(std::size_t number) const { return source_[number] != kFree; }
  [[nodiscard]] bool any() const { return !sources_.empty(); }
  /// (3 |V|), m, along each node's own axes; zero where nothing is prescribed.
  [[nodiscard]] const Eigen::VectorXd& displacement_m() const { return displacement_m_; }

 private:
  static constexpr std::uint32_t kFree = 0xFFFFFFFF;

  Eigen::VectorXd displacement_m_;
  std::vector<Eigen::Matrix3d> axes_;
  std::vector<std::uint32_t> source_;  // of each component: kFree, or which of sources_
  std::vector<std::string> sources_;
};

}  // namespace kiroku::sim

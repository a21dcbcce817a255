#include "sim/fem/rigid_motion.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

#include "base/number_text.h"
#include "sim/mesh/disjoint_sets.h"

namespace kiroku::sim {
namespace {

using Motion = Eigen::Matrix<double, 3, 6>;  // displacement of a point by (translation, rotation)

/// Below this ratio to the largest, a singular value counts as zero: the patch that holds a body may be a
/// millionth of its length.
constexpr double kNull = 1e-6;

struct Part {
  std::size_t tetrahedra = 0, node = 0;  // a node of its first tetrahedron
  Vector3 centre = Vector3::Zero();
  std::vector<std::uint32_t> nodes;
};

std::vector<Part> parts_of(const TetMesh& mesh, const Parts& parts) {
  std::vector<Part> all(parts.count);
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    Part& part = all[parts.of_tetrahedron[t]];
    if (part.tetrahedra++ == 0) part.node = mesh.tetrahedra[t][0];
    part.nodes.insert(part.nodes.end(), mesh.tetrahedra[t].begin(), mesh.tetrahedra[t].end());
  }
  for (Part& part : all) {
    std::ranges::sort(part.nodes);
    part.nodes.erase(std::unique(part.nodes.begin(), part.nodes.end()), part.nodes.end());
    for (const std::uint32_t node : part.nodes)
      part.centre += mesh.nodes[node] / static_cast<double>(part.nodes.size());
  }
  return all;
}

/// Translation and rotation about the part's centre, the latter scaled so that both weigh alike.
Motion motion_at(const Vector3& point, const Part& part, double length_m) {
  const Vector3 arm = (point - part.centre) / length_m;
  Motion motion = Motion::Zero();
  motion.leftCols<3>().setIdentity();
  motion.rightCols<3>() << 0, arm.z(), -arm.y(), -arm.z(), 0, arm.x(), arm.y(), -arm.x(), 0;
  return motion;
}

/// Adds the components of a node that are prescribed to the normal equations of its part's motion.
template <typename Normal>
void add_constraints(std::size_t node, const Motion& motion, const Constraints& constraints,
                     Normal&& normal) {
  for (std::size_t component = 0; component < 3; ++component) {
    if (!constraints.prescribed(3 * node + component)) continue;
    const auto axis = static_cast<Eigen::Index>(component);
    const Eigen::Matrix<double, 1, 6> row =
        constraints.turned() ? (constraints.axes()[node].col(axis).transpose() * motion).eval()
                             : motion.row(axis).eval();
    normal += row.transpose() * row;
  }
}

/// Of normal equations: the columns span what nothing prevents.
Eigen::MatrixXd null_space(const Eigen::MatrixXd& normal) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> decomposition(normal);
  const Eigen::VectorXd& values = decomposition.eigenvalues();  // ascending; squares of singular values
  const double limit = kNull * kNull * std::max(values[values.size() - 1], 1.0);
  return decomposition.eigenvectors().leftCols((values.array() <= limit).count());
}

/// An orthonormal basis of the columns' span.
Eigen::MatrixXd basis_of(const Eigen::MatrixXd& columns) {
  if (columns.cols() == 0) return columns;
  const Eigen::JacobiSVD<Eigen::MatrixXd> decomposition(columns, Eigen::ComputeThinU);
  const Eigen::Index rank = (decomposition.singularValues().array() > kNull).count();
  return decomposition.matrixU().leftCols(rank);
}

/// "x and y"; "the direction (0.71, 0.71, 0)" where the axes do not span it.
std::string directions_text(const Eigen::MatrixXd& basis) {
  std::vector<std::string> names;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    if (basis.row(axis).norm() > 1 - kNull) names.emplace_back(1, "xyz"[axis]);
  }
  if (static_cast<Eigen::Index>(names.size()) != basis.cols()) {
    names.clear();
    for (Eigen::Index i = 0; i < basis.cols(); ++i) {
      std::string text;
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        // Rounded, without the sign of a zero.
        text += (axis == 0 ? "(" : ", ") + number_text(std::round(basis(axis, i) * 100) / 100 + 0.0, 3);
      }
      names.push_back("the direction " + text + ")");
    }
  }
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  }
  return text;
}

/// `null` (6 x k): the part's free motions.
std::string motion_text(const Eigen::MatrixXd& null) {
  const Eigen::MatrixXd turns = basis_of(null.bottomRows<3>());
  // Combinations without rotation.
  const Eigen::JacobiSVD<Eigen::MatrixXd> decomposition(null.bottomRows<3>(), Eigen::ComputeFullV);
  const Eigen::Index rank = turns.cols();
  const Eigen::MatrixXd moves =
      basis_of(null.topRows<3>() * decomposition.matrixV().rightCols(null.cols() - rank));
  std::string text;
  if (moves.cols() > 0) text += "move along " + directions_text(moves);
  if (turns.cols() > 0) text += (text.empty() ? "turn about " : " and turn about ") + directions_text(turns);
  return text;
}

/// The free motions of parts that are linked by nodes, each with six rows of the result; none: no columns.
/// `first_at` (|V|) is memory to work in, -1 for the nodes of these parts.
Eigen::MatrixXd null_motions(const TetMesh& mesh, const Constraints& constraints,
                             const std::vector<Part>& parts, const std::vector<std::size_t>& members,
                             double length_m, std::vector<std::int64_t>& first_at) {
  const auto unknowns = static_cast<Eigen::Index>(6 * members.size());
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(unknowns, unknowns);
  // Which member moves each node first; others that share it must move alike.
  for (std::size_t member = 0; member < members.size(); ++member) {
    const Part& part = parts[members[member]];
    const auto own = static_cast<Eigen::Index>(6 * member);
    for (const std::uint32_t node : part.nodes) {
      const Motion motion = motion_at(mesh.nodes[node], part, length_m);
      if (first_at[node] < 0) {
        first_at[node] = static_cast<std::int64_t>(member);
        add_constraints(node, motion, constraints, normal.block<6, 6>(own, own));
        continue;
      }
      const auto other = static_cast<Eigen::Index>(6 * first_at[node]);
      const Motion others =
          motion_at(mesh.nodes[node], parts[members[static_cast<std::size_t>(first_at[node])]], length_m);
      normal.block<6, 6>(own, own) += motion.transpose() * motion;
      normal.block<6, 6>(other, other) += others.transpose() * others;
      normal.block<6, 6>(own, other) -= motion.transpose() * others;
      normal.block<6, 6>(other, own) -= others.transpose() * motion;
    }
  }
  return null_space(normal);
}

}  // namespace

std::vector<std::string> free_rigid_motions(const TetMesh& mesh, const Faces& faces,
                                            const Constraints& constraints) {
  const std::vector<Part> parts = parts_of(mesh, face_connected_parts(mesh, faces));
  // Parts that share nodes are judged together.
  DisjointSets groups(parts.size());
  std::vector<std::int64_t> first_at(mesh.nodes.size(), -1);
  for (std::uint32_t part = 0; part < parts.size(); ++part) {
    for (const std::uint32_t node : parts[part].nodes) {
      if (first_at[node] < 0) first_at[node] = part;
      groups.join(static_cast<std::uint32_t>(first_at[node]), part);
    }
  }
  std::vector<std::vector<std::size_t>> members(parts.size());
  for (std::uint32_t part = 0; part < parts.size(); ++part) members[groups.find(part)].push_back(part);
  const double length_m = std::max(extent_of(mesh).longest_side_m(), 1e-300);
  std::ranges::fill(first_at, -1);
  std::vector<std::string> sentences;
  for (const std::vector<std::size_t>& group : members) {
    if (group.empty() || group.size() > kMostHingedParts) continue;
    const Eigen::MatrixXd null = null_motions(mesh, constraints, parts, group, length_m, first_at);
    if (null.cols() == 0) continue;
    for (std::size_t member = 0; member < group.size(); ++member) {
      const Part& part = parts[group[member]];
      const Eigen::MatrixXd own = basis_of(null.middleRows<6>(static_cast<Eigen::Index>(6 * member)));
      if (own.cols() == 0) continue;
      sentences.push_back((parts.size() == 1 ? std::string("the body")
                                             : "the part of " + std::to_string(part.tetrahedra) +
                                                   (part.tetrahedra == 1 ? " tetrahedron" : " tetrahedra") +
                                                   " with node " + std::to_string(part.node)) +
                          " can " + motion_text(own));
    }
  }
  return sentences;
}

bool hold_still(const TetMesh& mesh, std::span<const std::uint32_t> nodes, const Constraints& constraints) {
  Part part;
  for (const std::uint32_t node : nodes) part.centre += mesh.nodes[node] / static_cast<double>(nodes.size());
  double length_m = 1e-300;
  for (const std::uint32_t node : nodes)
    length_m = std::max(length_m, (mesh.nodes[node] - part.centre).norm());
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(6, 6);
  for (const std::uint32_t node : nodes)
    add_constraints(node, motion_at(mesh.nodes[node], part, length_m), constraints, normal);
  return null_space(normal).cols() == 0;
}

}  // namespace kiroku::sim

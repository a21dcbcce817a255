#include "sim/manipulation/bound_nodes.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <utility>

#include <Eigen/Eigenvalues>

#include "base/error.h"
#include "sim/mesh/degrees_of_freedom.h"

namespace kiroku::sim {
namespace {

constexpr Eigen::Index kRigid = 6;

}  // namespace

BoundNodes::BoundNodes(const ContactBody& body) : body_(&body), bound_(body.body().mesh().nodes.size()) {
  const TetMesh& mesh = body.body().mesh();
  if (body.body().constraints().turned())
    throw Error("a body whose nodes have axes of their own cannot be grasped: prescribe along x, y and z");
  const Compliance& compliance = body.compliance();
  unheld_m_ = Eigen::VectorXd::Zero(first_row(compliance.rows()));
  if (compliance.complete()) {
    body.displacement_m({}, unheld_m_);
  } else {
    for (const std::uint32_t node : body.surface()) {
      unheld_m_.segment<3>(first_row(compliance.row_of(node))) =
          body.rest_m().segment<3>(first_row(node)) - mesh.nodes[node];
    }
  }
  grasped_m_ = unheld_m_;
}

void BoundNodes::bind(Hold hold) {
  const auto groups = body_->compliance().groups_of(hold.nodes);
  const std::size_t first = nodes_.size();
  for (std::size_t i = 0; i < hold.nodes.size(); ++i) {
    const std::uint32_t node = hold.nodes[i];
    nodes_.push_back({node, hold.tool, body_->compliance().row_of(node), groups[i],
                      Compliance::first_column(*groups[i], node)});
  }
  held_.push_back({std::move(hold), first, {}, {}});
  append_rows(first);
  prepare();
}

void BoundNodes::release(std::uint32_t tool) {
  const auto released = std::ranges::find(held_, tool, [](const Held& held) { return held.hold.tool; });
  const std::size_t first = released->first, count = released->hold.nodes.size();
  for (const std::uint32_t node : released->hold.nodes) bound_[node] = 0;
  for (auto later = released + 1; later != held_.end(); ++later) later->first -= count;
  const auto begin = nodes_.begin() + static_cast<std::ptrdiff_t>(first);
  nodes_.erase(begin, begin + static_cast<std::ptrdiff_t>(count));
  held_.erase(released);
  while (!free_.empty() && free_.back() >= first_row(first)) free_.pop_back();
  compliance_.truncate(static_cast<Eigen::Index>(free_.size()));
  append_rows(first);
  prepare();
}

std::size_t BoundNodes::held_by(std::uint32_t tool) const {
  const auto found = std::ranges::find(held_, tool, [](const Held& held) { return held.hold.tool; });
  return found == held_.end() ? 0 : found->hold.nodes.size();
}

std::vector<BoundNodes::Hold> BoundNodes::holds() const {
  std::vector<Hold> all;
  for (const Held& held : held_) all.push_back(held.hold);
  return all;
}

void BoundNodes::append_rows(std::size_t first) {
  const std::size_t before = free_.size();
  for (std::size_t i = first; i < nodes_.size(); ++i) {
    bound_[nodes_[i].node] = 1;
    for (Eigen::Index component = 0; component < 3; ++component) {
      const auto number = static_cast<std::size_t>(first_row(nodes_[i].node) + component);
      if (!body_->body().constraints().prescribed(number)) free_.push_back(first_row(i) + component);
    }
  }
  Eigen::MatrixXd last_rows(static_cast<Eigen::Index>(free_.size() - before),
                            static_cast<Eigen::Index>(free_.size()));
  for (Eigen::Index column = 0; column < last_rows.cols(); ++column) {
    const Eigen::Index of_column = free_[static_cast<std::size_t>(column)];
    const auto all_rows = nodes_[static_cast<std::size_t>(of_column / 3)].columns().col(of_column % 3);
    for (Eigen::Index row = 0; row < last_rows.rows(); ++row) {
      const Eigen::Index of_row = free_[before + static_cast<std::size_t>(row)];
      last_rows(row, column) =
          all_rows[first_row(nodes_[static_cast<std::size_t>(of_row / 3)].row) + of_row % 3];
    }
  }
  if (!compliance_.append(last_rows)) {
    throw Error("the compliance of the " + std::to_string(nodes_.size()) +
                " nodes that tools hold is too badly conditioned: moduli differ too much, or a "
                "Poisson's ratio is too near 0.5");
  }
}

Eigen::MatrixXd BoundNodes::fixing_n(const Eigen::MatrixXd& displacement_m) const {
  Eigen::MatrixXd force_n = Eigen::MatrixXd::Zero(displacement_m.rows(), displacement_m.cols());
  force_n(free_, Eigen::all) = compliance_.solve(displacement_m(free_, Eigen::all));
  return force_n;
}

Eigen::MatrixXd BoundNodes::holding_n(const Eigen::MatrixXd& displacement_m) const {
  Eigen::MatrixXd force_n = fixing_n(displacement_m);
  if (rigid_.cols() > 0) {
    const Eigen::MatrixXd unbalanced = rigid_.transpose() * force_n;
    force_n -= rigid_n_ * floating_.solve(unbalanced);
  }
  return force_n;
}

Eigen::MatrixXd BoundNodes::rigid_motions(const Hold& hold) const {
  Eigen::MatrixXd motions(first_row(hold.nodes.size()), kRigid);
  for (std::size_t i = 0; i < hold.nodes.size(); ++i) {
    const Vector3 arm_m =
        body_->body().mesh().nodes[hold.nodes[i]] + hold.displacements_m[i] - hold.pose.position_m;
    auto of_node = motions.middleRows<3>(first_row(i));
    of_node.leftCols<3>().setIdentity();
    for (Eigen::Index axis = 0; axis < 3; ++axis) of_node.col(3 + axis) = Vector3::Unit(axis).cross(arm_m);
  }
  return motions;
}

void BoundNodes::prepare_floating() {
  const auto floating = std::ranges::count_if(held_, [](const Held& held) { return held.hold.floats; });
  rigid_ = Eigen::MatrixXd::Zero(first_row(nodes_.size()), kRigid * floating);
  Eigen::Index column = 0;
  for (const Held& held : held_) {
    if (!held.hold.floats) continue;
    rigid_.block(first_row(held.first), column, first_row(held.hold.nodes.size()), kRigid) =
        rigid_motions(held.hold);
    column += kRigid;
  }
  if (column == 0) return;
  rigid_n_ = fixing_n(rigid_);
  floating_.compute(rigid_.transpose() * rigid_n_);
  if (floating_.info() != Eigen::Success)
    throw Error("what a clip holds cannot turn freely: too many of its nodes are fixed");
}

bool BoundNodes::floats(std::uint32_t tool) const {
  return std::ranges::any_of(held_,
                             [&](const Held& held) { return held.hold.tool == tool && held.hold.floats; });
}

Pose BoundNodes::floating_pose(std::uint32_t tool, const Eigen::VectorXd& displacement_m) const {
  const auto held = std::ranges::find(held_, tool, [](const Held& one) { return one.hold.tool; });
  const Hold& hold = held->hold;
  Eigen::VectorXd moved_m(first_row(hold.nodes.size()));
  for (std::size_t i = 0; i < hold.nodes.size(); ++i) {
    moved_m.segment<3>(first_row(i)) =
        displacement_m.segment<3>(first_row(nodes_[held->first + i].row)) - hold.displacements_m[i];
  }
  const Eigen::MatrixXd motions = rigid_motions(hold);
  const Eigen::Matrix<double, kRigid, 1> motion =
      (motions.transpose() * motions).ldlt().solve(motions.transpose() * moved_m);
  const Vector3 turn = motion.tail<3>();
  Pose pose{hold.pose.position_m + motion.head<3>(), hold.pose.orientation};
  if (turn.norm() > 0) {
    pose.orientation =
        (Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized())) * hold.pose.orientation)
            .normalized();
  }
  return pose;
}

bool BoundNodes::span_a_plane(std::span<const Vector3> places_m) {
  Vector3 middle_m = Vector3::Zero();
  for (const Vector3& place_m : places_m) middle_m += place_m / static_cast<double>(places_m.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Vector3& place_m : places_m) spread += (place_m - middle_m) * (place_m - middle_m).transpose();
  constexpr double kSquaredThousandth = 1e-6;
  const Vector3 squares = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvalues();
  return squares[1] > kSquaredThousandth * squares[2];
}

void BoundNodes::add_displacements(const Eigen::MatrixXd& force_n, Eigen::MatrixXd& displacement_m) const {
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    displacement_m.noalias() += nodes_[i].columns().lazyProduct(force_n.middleRows<3>(first_row(i)));
  }
}

/// What a motion of each tool does, when it has been told what is bound.
void BoundNodes::prepare() {
  pressed_.clear();
  prepare_floating();
  const Eigen::Index bound = first_row(nodes_.size());
  Eigen::MatrixXd pulled_m(bound, 1);
  for (const Held& held : held_) {
    for (std::size_t i = 0; i < held.hold.nodes.size(); ++i) {
      const std::size_t node = held.first + i;
      pulled_m.middleRows<3>(first_row(node)) =
          held.hold.displacements_m[i] - unheld_m_.segment<3>(first_row(nodes_[node].row));
    }
  }
  const Eigen::MatrixXd grasped_n = holding_n(pulled_m);
  Eigen::MatrixXd grasped_m = unheld_m_;
  add_displacements(grasped_n, grasped_m);
  grasped_n_ = grasped_n;
  grasped_m_ = grasped_m;

  for (Held& held : held_) {
    if (held.hold.floats) continue;
    Eigen::MatrixXd moved_m = Eigen::MatrixXd::Zero(bound, kMotion);
    for (std::size_t i = 0; i < held.hold.nodes.size(); ++i) {
      const Vector3 from_tool_m = body_->body().mesh().nodes[held.hold.nodes[i]] +
                                  held.hold.displacements_m[i] - held.hold.pose.position_m;
      auto of_node = moved_m.middleRows<3>(first_row(held.first + i));
      for (Eigen::Index j = 0; j < 3; ++j)
        of_node.middleCols<3>(3 * j).diagonal().setConstant(from_tool_m[j]);
      of_node.rightCols<3>().setIdentity();
    }
    held.force_n = holding_n(moved_m);
    held.displacement_m = Eigen::MatrixXd::Zero(unheld_m_.size(), kMotion);
    add_displacements(held.force_n, held.displacement_m);
  }
}

BoundNodes::Motion BoundNodes::motion(const Hold& hold, std::span<const OptionalPose> poses) {
  const Pose& now = *poses[hold.tool];
  const Eigen::Matrix3d turned =
      (now.orientation * hold.pose.orientation.conjugate()).toRotationMatrix() - Eigen::Matrix3d::Identity();
  Motion motion;
  motion << turned.reshaped(), now.position_m - hold.pose.position_m;
  return motion;
}

void BoundNodes::displacement_m(std::span<const OptionalPose> poses, Eigen::VectorXd& displacement_m) const {
  displacement_m = grasped_m_;
  for (const Held& held : held_) {
    if (!held.hold.floats) displacement_m.noalias() += held.displacement_m * motion(held.hold, poses);
  }
}

Eigen::MatrixXd BoundNodes::pushed_m(std::uint32_t node) const {
  const Eigen::Index row = first_row(body_->compliance().row_of(node));
  Eigen::MatrixXd pushed_m(first_row(nodes_.size()), 3);
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    pushed_m.middleRows<3>(first_row(i)) = nodes_[i].columns().middleRows<3>(row).transpose();
  return pushed_m;
}

void BoundNodes::learn_columns(std::span<const Contact> contacts) {
  std::set<std::uint32_t> now;
  for (const Contact& contact : contacts) now.insert(contact.node);
  std::erase_if(pressed_, [&](const auto& known) { return !now.contains(known.first); });
  std::vector<std::uint32_t> nodes;
  std::ranges::copy_if(now, std::back_inserter(nodes), [&](auto node) { return !pressed_.contains(node); });
  if (nodes.empty()) return;
  // All together, so that what is known of the bound nodes is read once.
  Eigen::MatrixXd pushed(first_row(nodes_.size()), first_row(nodes.size())),
      columns(unheld_m_.size(), first_row(nodes.size()));
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const auto group = body_->compliance().group_of(nodes[i]);
    columns.middleCols<3>(first_row(i)) =
        group->columns.middleCols<3>(Compliance::first_column(*group, nodes[i]));
    pushed.middleCols<3>(first_row(i)) = -pushed_m(nodes[i]);
  }
  add_displacements(holding_n(pushed), columns);
  for (std::size_t i = 0; i < nodes.size(); ++i) pressed_[nodes[i]] = columns.middleCols<3>(first_row(i));
}

void BoundNodes::add_contacts(std::span<const Contact> contacts, Eigen::VectorXd& displacement_m) {
  learn_columns(contacts);
  for (const Contact& contact : contacts)
    displacement_m += pressed_.at(contact.node).lazyProduct(contact.force_n);
}

std::vector<BoundNode> BoundNodes::forces(std::span<const OptionalPose> poses,
                                          std::span<const Contact> contacts) const {
  Eigen::VectorXd force_n = grasped_n_;
  for (const Held& held : held_) {
    if (!held.hold.floats) force_n.noalias() += held.force_n * motion(held.hold, poses);
  }
  if (!contacts.empty() && !nodes_.empty()) {
    Eigen::VectorXd pushed = Eigen::VectorXd::Zero(force_n.size());
    for (const Contact& contact : contacts) pushed += pushed_m(contact.node) * contact.force_n;
    force_n -= holding_n(pushed);
  }
  std::vector<BoundNode> all;
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    all.push_back({nodes_[i].node, nodes_[i].tool, force_n.segment<3>(first_row(i))});
  std::ranges::sort(all, {}, [](const BoundNode& bound) { return std::pair(bound.tool, bound.node); });
  return all;
}

std::shared_ptr<ContactNeighbourhood> BoundNodes::neighbourhood(std::span<const std::uint32_t> places) const {
  auto held = std::make_shared<ContactNeighbourhood>(*body_->neighbourhood(places));
  if (nodes_.empty() || places.empty()) return held;
  // L^-1 C_bc; its square is the compliance that holding takes from the body.
  Eigen::MatrixXd across(static_cast<Eigen::Index>(free_.size()), held->compliance.cols());
  for (std::size_t row = 0; row < free_.size(); ++row) {
    const Node& node = nodes_[static_cast<std::size_t>(free_[row] / 3)];
    const auto column = node.columns().col(free_[row] % 3);
    for (std::size_t point = 0; point < held->nodes.size(); ++point) {
      across.block<1, 3>(static_cast<Eigen::Index>(row), first_row(point)) =
          column.segment<3>(first_row(body_->compliance().row_of(held->nodes[point]))).transpose();
    }
  }
  across = compliance_.solve_lower(std::move(across));
  if (rigid_.cols() > 0) {
    const Eigen::MatrixXd rigid = compliance_.solve_lower(rigid_(free_, Eigen::all));
    const Eigen::MatrixXd along = rigid.transpose() * across;
    across -= rigid * floating_.solve(along);
  }
  held->compliance.selfadjointView<Eigen::Lower>().rankUpdate(across.transpose(), -1);
  held->compliance.triangularView<Eigen::StrictlyUpper>() = held->compliance.transpose();
  return held;
}

}  // namespace kiroku::sim

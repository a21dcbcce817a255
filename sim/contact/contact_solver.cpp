#include "sim/contact/contact_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "base/error.h"

namespace kiroku::sim {
namespace {

constexpr std::uint32_t kNoPlace = std::numeric_limits<std::uint32_t>::max();
/// Along a direction in which a node moves under a force by less than this part of what it does in all three
/// together, it is held.
constexpr double kHeld = 1e-9;
/// Friction fits normal forces and slip where renewing it changes it by no more than this part of the largest
/// normal force. So often it is renewed in a step; what is left then is made up for by the next steps.
constexpr double kFrictionTolerance = 1e-3;
constexpr int kMostFrictionUpdates = 12;
/// Room that is there from the beginning, in rows a tool.
constexpr std::size_t kUsualRows = 48;

/// Two directions across one, of length 1; the same normal gives the same ones.
std::pair<Vector3, Vector3> across(const Vector3& normal) {
  Eigen::Index least = 0;
  normal.cwiseAbs().minCoeff(&least);
  const Vector3 one = normal.cross(Vector3::Unit(least)).normalized();
  return {one, normal.cross(one)};
}

}  // namespace

ContactSolver::ContactSolver(std::shared_ptr<const ContactNeighbourhood> neighbourhood,
                             std::vector<ContactTool> tools, const ContactOptions& options)
    : neighbourhood_(std::move(neighbourhood)),
      tools_(std::move(tools)),
      options_(options),
      poses_(tools_.size()),
      rotations_(tools_.size(), Eigen::Matrix3d::Identity()),
      touch_at_(tools_.size() * neighbourhood_->nodes.size(), kNoPlace),
      bound_(neighbourhood_->nodes.size()),
      touching_(neighbourhood_->nodes.size()),
      tree_(neighbourhood_->nodes.size()),
      rest_m_(neighbourhood_->rest_m),
      positions_m_(rest_m_),
      tolerance_m_(options.tolerance * neighbourhood_->size_m) {
  for (const ContactTool& tool : tools_) {
    if (const std::string problem = problem_of(tool.shape); !problem.empty())
      throw UsageError("nothing can be touched with " + tool.name + ": " + problem);
    if (tool.sticks && !(tool.friction > 0))
      throw UsageError("the friction of " + tool.name +
                       " must be greater than zero: without friction a tool does not stick");
    reach_m_.push_back(bounding_radius_m(tool.shape));
  }
  if (!(options_.tolerance > 0) || options_.most_iterations < 1)
    throw UsageError("a contact needs a tolerance greater than zero and one iteration at least");
  poses_before_.reserve(tools_.size());
  result_.tools.resize(tools_.size());
  reserve(kUsualRows * tools_.size() / rows_per_contact());
  tree_.refit(positions_m_);
}

std::size_t ContactSolver::rows_per_contact() const {
  return std::ranges::any_of(tools_, &ContactTool::sticks) ? 3 : 1;
}

void ContactSolver::reserve(std::size_t contacts) {
  touches_.reserve(contacts);
  before_.reserve(contacts);
  result_.contacts.reserve(contacts);
  rows_.reserve(rows_per_contact() * contacts);
  problem_.reserve(rows_per_contact() * contacts);
}

bool ContactSolver::continue_from(const ContactSolver& previous) {
  take_touches(previous, {});
  // With the same forces a node lies where it lay. So only what previous did not know is computed, where all
  // of its positions would cost a force loop another pass over the compliance.
  const bool all = touches_.size() == previous.touches_.size();
  const bool more = all && move_from(previous);
  if (!all) move();
  report_as(previous);
  return all && !more;
}

void ContactSolver::continue_from(const ContactSolver& previous, std::span<const std::uint32_t> tool_there) {
  take_touches(previous, tool_there);
  move();
  report_as(previous);
}

/// Every tool is the same where `tool_there` is empty.
void ContactSolver::take_touches(const ContactSolver& previous, std::span<const std::uint32_t> tool_there) {
  const std::vector<std::uint32_t>& nodes = neighbourhood_->nodes;
  const auto there_of = [&](std::uint32_t tool) { return tool_there.empty() ? tool : tool_there[tool]; };
  for (std::uint32_t tool = 0; tool < tools_.size(); ++tool) {
    const std::uint32_t there = there_of(tool);
    if (there >= previous.tools_.size()) continue;
    poses_[tool] = previous.poses_[there];
    rotations_[tool] = previous.rotations_[there];
  }
  touches_.clear();
  for (Touch touch : previous.touches_) {
    std::uint32_t here = 0;
    while (here < tools_.size() && there_of(here) != touch.tool) ++here;
    if (here == tools_.size()) continue;
    touch.tool = here;
    const auto found = std::ranges::find(nodes, previous.neighbourhood_->nodes[touch.point]);
    if (found == nodes.end()) continue;
    touch.point = static_cast<std::uint32_t>(found - nodes.begin());
    touches_.push_back(touch);
  }
  std::ranges::fill(touch_at_, kNoPlace);
  keep(true);
}

/// move() where previous has the same touches; whether a node that it did not know is inside a tool.
bool ContactSolver::move_from(const ContactSolver& previous) {
  const std::vector<std::uint32_t>& nodes = neighbourhood_->nodes;
  const std::vector<std::uint32_t>& known = previous.neighbourhood_->nodes;
  bool inside = false;
  auto next = known.begin();  // both are in the order of the surface
  for (std::uint32_t point = 0; point < nodes.size(); ++point) {
    auto at_m = positions_m_.segment<3>(3 * Eigen::Index{point});
    if (const auto there = std::find(next, known.end(), nodes[point]); there != known.end()) {
      at_m = previous.position_m(static_cast<std::uint32_t>(there - known.begin()));
      next = there + 1;
      continue;
    }
    at_m = rest_m_.segment<3>(3 * Eigen::Index{point});
    const auto gives_way = neighbourhood_->compliance.middleCols<3>(3 * Eigen::Index{point});  // symmetric
    for (const Touch& touch : touches_) {
      if (touch.pressing)
        at_m += gives_way.middleRows<3>(3 * Eigen::Index{touch.point}).transpose() * touch.force_n;
    }
    for (std::uint32_t tool = 0; tool < tools_.size() && !inside; ++tool)
      inside = distance(tool, point).distance_m < -tolerance_m_;
  }
  tree_.refit(positions_m_);
  return inside;
}

void ContactSolver::report_as(const ContactSolver& previous) {
  deepest_m_ = previous.result_.deepest_penetration_m;
  largest_gap_m_ = previous.result_.largest_gap_m;
  iterations_ = previous.result_.iterations;
  converged_ = previous.result_.converged;
  report();
}

SurfaceDistance ContactSolver::distance(std::uint32_t tool, std::uint32_t point) const {
  SurfaceDistance found = distance_to(
      tools_[tool].shape, rotations_[tool].transpose() * (position_m(point) - poses_[tool].position_m));
  found.normal = rotations_[tool] * found.normal;
  return found;
}

void ContactSolver::rest_at(Eigen::VectorXd rest_m) {
  rest_m_ = std::move(rest_m);
  move();
}

void ContactSolver::check(std::span<const Pose> poses) const {
  if (poses.size() != tools_.size()) {
    throw UsageError(std::to_string(tools_.size()) + " tools need as many poses; there are " +
                     std::to_string(poses.size()));
  }
  for (std::size_t tool = 0; tool < tools_.size(); ++tool) {
    if (!poses[tool].sound()) {
      throw Error("the pose of " + tools_[tool].name +
                  " is none: its numbers must be finite and its quaternion of length 1");
    }
  }
}

const ContactResult& ContactSolver::step(std::span<const Pose> poses) {
  check(poses);
  const auto go_to = [this](std::span<const Pose> there) {
    poses_.assign(there.begin(), there.end());
    for (std::size_t tool = 0; tool < poses_.size(); ++tool)
      rotations_[tool] = poses_[tool].orientation.toRotationMatrix();
  };
  before_ = touches_;
  poses_before_ = poses_;
  go_to(poses);
  try {
    find_balance();
  } catch (...) {
    touches_ = before_;
    std::ranges::fill(touch_at_, kNoPlace);
    keep(true);
    go_to(poses_before_);
    move();
    throw;
  }
  report();
  keep(false);
  hold_where_it_lies();
  return result_;
}

void ContactSolver::find_balance() {
  for (Touch& touch : touches_) {
    touch.sliding = false;
    touch.friction_n.setZero();
    if (tools_[touch.tool].sticks && !touch.bound) bind(touch);
  }
  add_touching(0);
  iterations_ = 0;
  largest_gap_m_ = 0;
  converged_ = touches_.empty();
  int friction_updates = 0;
  while (!converged_ && iterations_ < options_.most_iterations) {
    do {
      make_rows();
      solve_rows();
    } while (release() || slip() || ((friction_updates++ < kMostFrictionUpdates && update_friction())));
    move();
    ++iterations_;
    const bool more = add_touching(tolerance_m_);
    converged_ = settled() && !more;
  }
}

/// Nodes that are deeper inside than this become touches; whether there were any. Finds the deepest of all.
bool ContactSolver::add_touching(double depth_m) {
  const std::size_t known = touches_.size();
  deepest_m_ = 0;
  for (std::uint32_t tool = 0; tool < tools_.size(); ++tool) {
    tree_.visit_near(poses_[tool].position_m, reach_m_[tool], [&](std::size_t at) {
      const auto point = static_cast<std::uint32_t>(at);
      if ((position_m(point) - poses_[tool].position_m).squaredNorm() >= reach_m_[tool] * reach_m_[tool])
        return;
      const SurfaceDistance found = distance(tool, point);
      if (found.distance_m >= 0) return;
      const std::uint32_t touch = touch_at(tool, point);
      if (touch != kNoPlace && touches_[touch].blocked) return;
      deepest_m_ = std::max(deepest_m_, -found.distance_m);
      if (touch != kNoPlace || found.distance_m >= -depth_m) return;
      touch_at(tool, point) = static_cast<std::uint32_t>(touches_.size());
      Touch& added = touches_.emplace_back();
      added.point = point;
      added.tool = tool;
      added.pressing = true;  // to begin with
      added.normal = found.normal;
      ++touching_[point];
      if (tools_[tool].sticks) bind(added);
    });
  }
  return touches_.size() > known;
}

void ContactSolver::bind(Touch& touch) {
  if (neighbourhood_->free[touch.point] == 0 || bound_[touch.point] != 0) return;
  if (tools_[touch.tool].slides() && !rubs(touch)) return;
  const Vector3 at_m =
      rotations_[touch.tool].transpose() * (position_m(touch.point) - poses_[touch.tool].position_m);
  const SurfaceDistance found = distance_to(tools_[touch.tool].shape, at_m);
  touch.anchor_m = at_m - found.distance_m * found.normal;
  touch.anchor_normal = found.normal;
  touch.bound = true;
  bound_[touch.point] = 1;
}

void ContactSolver::make_rows() {
  rows_.clear();
  for (std::uint32_t i = 0; i < touches_.size(); ++i) {
    Touch& touch = touches_[i];
    const auto at = 3 * Eigen::Index{touch.point};
    const Vector3 rest_m = rest_m_.segment<3>(at);
    if ((touch.bound || touch.sliding) && tools_[touch.tool].slides() && !rubs(touch)) {
      if (touch.bound) bound_[touch.point] = 0;
      touch.bound = touch.sliding = false;
      touch.friction_n.setZero();
    }
    if (touch.bound) {
      const Eigen::Matrix3d& rotation = rotations_[touch.tool];
      touch.normal = rotation * touch.anchor_normal;
      const Vector3 from_anchor_m = rest_m - (rotation * touch.anchor_m + poses_[touch.tool].position_m);
      const auto [one, other] = across(touch.anchor_normal);
      rows_.push_back({i, touch.point, touch.normal, touch.normal.dot(from_anchor_m), false});
      for (const Vector3& direction : {Vector3(rotation * one), Vector3(rotation * other)})
        rows_.push_back({i, touch.point, direction, direction.dot(from_anchor_m), true});
      continue;
    }
    const SurfaceDistance found = distance(touch.tool, touch.point);
    touch.normal = found.normal;
    const auto own = neighbourhood_->compliance.block<3, 3>(at, at);
    touch.blocked = found.normal.dot(own * found.normal) <= kHeld * own.trace();
    if (touch.blocked) continue;
    rows_.push_back({i, touch.point, found.normal,
                     found.distance_m + found.normal.dot(rest_m - position_m(touch.point)), false});
  }
}

void ContactSolver::solve_rows() {
  problem_.resize(rows_.size());
  auto matrix = problem_.matrix();
  auto gap_m = problem_.gap();
  for (std::size_t b = 0; b < rows_.size(); ++b) {
    const Row& column = rows_[b];
    const auto of_column = neighbourhood_->compliance.middleCols<3>(3 * Eigen::Index{column.point});
    const auto at_b = static_cast<Eigen::Index>(b);
    std::uint32_t point = kNoPlace;
    Vector3 moves_m;  // the point, under 1 N of this row
    for (std::size_t a = b; a < rows_.size(); ++a) {
      const Row& row = rows_[a];
      if (row.point != point) {
        point = row.point;
        moves_m = of_column.middleRows<3>(3 * Eigen::Index{point}) * column.direction;
      }
      matrix(static_cast<Eigen::Index>(a), at_b) = row.direction.dot(moves_m);
    }
    gap_m[at_b] = column.gap_m;
    problem_.equality()[b] = column.equality ? 1 : 0;
    problem_.pressing()[b] = touches_[column.touch].pressing ? 1 : 0;
  }
  for (const Touch& touch : touches_) {
    if (!touch.sliding || touch.friction_n.isZero(0)) continue;
    const auto of_touch = neighbourhood_->compliance.middleCols<3>(3 * Eigen::Index{touch.point});
    for (std::size_t a = 0; a < rows_.size(); ++a) {
      const Row& row = rows_[a];
      gap_m[static_cast<Eigen::Index>(a)] +=
          row.direction.dot(of_touch.middleRows<3>(3 * Eigen::Index{row.point}) * touch.friction_n);
    }
  }
  problem_.solve();
  if (problem_.largest_violation() > tolerance_m_ / 2) refuse(rows_[problem_.worst_row()]);
  const auto force_n = problem_.force();
  for (Touch& touch : touches_) {
    touch.force_n = touch.friction_n;
    touch.pressing = false;
  }
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const Row& row = rows_[i];
    Touch& touch = touches_[row.touch];
    touch.force_n += force_n[static_cast<Eigen::Index>(i)] * row.direction;
    if (!row.equality) touch.pressing = problem_.pressing()[i] != 0;
  }
}

/// Of bound nodes that would have to be pulled; whether there were any.
bool ContactSolver::release() {
  bool any = false;
  for (Touch& touch : touches_) {
    if (!touch.bound || touch.pressing) continue;
    touch.bound = false;
    touch.pressing = true;  // perhaps it still does without being dragged
    bound_[touch.point] = 0;
    any = true;
    if (!tools_[touch.tool].slides()) continue;
    // It may yet be dragged by less.
    touch.along = touch.force_n - touch.force_n.dot(touch.normal) * touch.normal;
    touch.sliding = touch.along.norm() > 0;
    touch.along.stableNormalize();
  }
  return any;
}

/// Of bound nodes that friction cannot hold, and friction of those that do not press; whether there were any.
bool ContactSolver::slip() {
  bool any = false;
  for (Touch& touch : touches_) {
    if (touch.sliding && !touch.pressing) {
      touch.sliding = false;  // for the rest of the step
      any = any || !touch.friction_n.isZero(0);
      touch.friction_n.setZero();
      touch.force_n.setZero();
    }
    if (!touch.bound || !tools_[touch.tool].slides()) continue;
    const double most_n = tools_[touch.tool].friction * touch.force_n.dot(touch.normal);
    const Vector3 across_n = touch.force_n - touch.force_n.dot(touch.normal) * touch.normal;
    if (across_n.norm() <= (1 + kFrictionTolerance) * most_n) continue;
    touch.bound = false;
    touch.sliding = true;
    touch.along = across_n.normalized();
    touch.friction_n = most_n * touch.along;
    bound_[touch.point] = 0;
    any = true;
  }
  return any;
}

/// How far a node that slides is from where it was bound, over the tool.
Vector3 ContactSolver::slip_m(const Touch& touch) const {
  const auto at = 3 * Eigen::Index{touch.point};
  Vector3 slip_m =
      rest_m_.segment<3>(at) - rotations_[touch.tool] * touch.anchor_m - poses_[touch.tool].position_m;
  for (const Touch& other : touches_) {
    if (other.pressing)
      slip_m += neighbourhood_->compliance.block<3, 3>(at, 3 * Eigen::Index{other.point}) * other.force_n;
  }
  return slip_m - slip_m.dot(touch.normal) * touch.normal;
}

/// Fits friction to how hard nodes press, and turns it against the way they slide; whether it was otherwise.
bool ContactSolver::update_friction() {
  double largest_n = 0, wrong_n = 0;
  const auto sliding = static_cast<double>(std::ranges::count(touches_, true, &Touch::sliding));
  for (Touch& touch : touches_) {
    if (!touch.pressing) continue;
    const double normal_n = (touch.force_n - touch.friction_n).dot(touch.normal);
    largest_n = std::max(largest_n, normal_n);
    if (!touch.sliding) continue;
    const double most_n = tools_[touch.tool].friction * normal_n;
    const auto own =
        neighbourhood_->compliance.block<3, 3>(3 * Eigen::Index{touch.point}, 3 * Eigen::Index{touch.point});
    // What would bring it back by itself, as far as friction reaches; all that slide move each other.
    touch.along = most_n * touch.along - 3 / (sliding * own.trace()) * slip_m(touch);
    touch.along -= touch.along.dot(touch.normal) * touch.normal;  // the plane may have turned since
    touch.along.stableNormalize();
    const Vector3 friction_n = most_n * touch.along;
    wrong_n = std::max(wrong_n, (friction_n - touch.friction_n).norm());
    touch.friction_n = friction_n;
  }
  return wrong_n > kFrictionTolerance * largest_n;
}

/// What slid or was let go is bound again from where it lies now, so that the next step takes it along.
void ContactSolver::hold_where_it_lies() {
  for (Touch& touch : touches_) {
    if (tools_[touch.tool].slides() && !touch.bound) bind(touch);
  }
}

void ContactSolver::move() {
  positions_m_ = rest_m_;
  for (const Touch& touch : touches_) {
    if (!touch.pressing) continue;
    positions_m_ +=
        neighbourhood_->compliance.middleCols<3>(3 * Eigen::Index{touch.point}).lazyProduct(touch.force_n);
  }
  tree_.refit(positions_m_);
}

/// Whether what presses lies on its tool.
bool ContactSolver::settled() {
  largest_gap_m_ = 0;
  for (const Touch& touch : touches_) {
    if (!touch.pressing || touch.bound) continue;
    largest_gap_m_ = std::max(largest_gap_m_, std::abs(distance(touch.tool, touch.point).distance_m));
  }
  return largest_gap_m_ <= tolerance_m_;
}

/// Forgets touches that do not press, unless all are to be kept, and counts the others anew.
void ContactSolver::keep(bool all) {
  std::ranges::fill(bound_, 0);
  std::ranges::fill(touching_, 0);
  for (const Touch& touch : touches_) touch_at(touch.tool, touch.point) = kNoPlace;
  if (!all) std::erase_if(touches_, [](const Touch& touch) { return !touch.pressing; });
  for (std::uint32_t i = 0; i < touches_.size(); ++i) {
    touch_at(touches_[i].tool, touches_[i].point) = i;
    ++touching_[touches_[i].point];
    if (touches_[i].bound) bound_[touches_[i].point] = 1;
  }
}

void ContactSolver::report() {
  result_.contacts.clear();
  result_.wrist_force_n.setZero();
  for (ToolForce& tool : result_.tools) tool = {};
  for (const Touch& touch : touches_) {
    if (!touch.pressing || touch.force_n.isZero(0)) continue;
    Contact& contact = result_.contacts.emplace_back();
    contact.node = neighbourhood_->nodes[touch.point];
    contact.tool = touch.tool;
    contact.force_n = touch.force_n;
    contact.normal = touch.normal;
    contact.pressure_pa = touch.force_n.dot(touch.normal) / neighbourhood_->area_m2[touch.point];
    ToolForce& tool = result_.tools[touch.tool];
    ++tool.nodes;
    tool.force_n -= touch.force_n;
    tool.torque_nm -= (position_m(touch.point) - poses_[touch.tool].position_m).cross(touch.force_n);
  }
  for (std::uint32_t i = 0; i < result_.tools.size(); ++i) {
    ToolForce& tool = result_.tools[i];
    Vector3 normal = Vector3::Zero();
    for (const Touch& touch : touches_) {
      if (touch.pressing && touch.tool == i) normal += neighbourhood_->area_m2[touch.point] * touch.normal;
    }
    if (const double length = normal.norm(); length > 0) normal /= length;
    tool.normal_n = -tool.force_n.dot(normal);
    tool.tangential_n = (tool.force_n + tool.normal_n * normal).norm();
    result_.wrist_force_n += tool.force_n;
  }
  std::ranges::sort(result_.contacts, [](const Contact& a, const Contact& b) {
    return std::tie(a.tool, a.node) < std::tie(b.tool, b.node);
  });
  result_.iterations = iterations_;
  result_.converged = converged_;
  result_.deepest_penetration_m = deepest_m_;
  result_.largest_gap_m = largest_gap_m_;
}

void ContactSolver::refuse(const Row& row) const {
  const std::uint32_t tool = touches_[row.touch].tool;
  std::string sentence = tools_[tool].name;
  for (const Touch& touch : touches_) {
    if (touch.point == row.point && touch.tool != tool) sentence += " and " + tools_[touch.tool].name;
  }
  throw Error(sentence + " leave node " + std::to_string(neighbourhood_->nodes[row.point]) +
              " no place: they overlap there, so move them apart");
}

}  // namespace kiroku::sim

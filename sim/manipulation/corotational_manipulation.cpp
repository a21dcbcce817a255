#include "sim/manipulation/corotational_manipulation.h"

#include <algorithm>
#include <string>
#include <utility>

#include <Eigen/LU>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/contact/near_tools.h"
#include "sim/mesh/degrees_of_freedom.h"

namespace kiroku::sim {
namespace {

constexpr std::uint32_t kNobody = 0xFFFFFFFF;
/// How far around tools that press nodes are taken together, in lengths of the body.
constexpr double kCorotationalMargin = 0.02;
constexpr int kMostNewtonSteps = 50;
constexpr double kSmallestPart = 1.0 / 256;  // of a step's motion
constexpr int kMostStepHalvings = 33;        // of Newton's step
constexpr double kSufficientDecrease = 1e-4;
constexpr double kOnFace = 1e-9;         // weights within an element may miss its face by rounding
constexpr double kHoldRounding = 1e-14;  // of where a held node is to be, in lengths of the body

/// Zero where nothing is free.
Eigen::VectorXd where_free(Eigen::VectorXd vector, const std::vector<bool>& free) {
  for (std::size_t i = 0; i < free.size(); ++i) {
    if (!free[i]) vector[static_cast<Eigen::Index>(i)] = 0;
  }
  return vector;
}

bool same_poses(std::span<const OptionalPose> a, std::span<const OptionalPose> b) {
  return std::ranges::equal(a, b, [](const OptionalPose& one, const OptionalPose& other) {
    if (!one || !other) return one.has_value() == other.has_value();
    return one->position_m == other->position_m && one->orientation.coeffs() == other->orientation.coeffs();
  });
}

double largest(const Eigen::VectorXd& vector) { return vector.cwiseAbs().maxCoeff(); }

}  // namespace

CorotationalManipulation::CorotationalManipulation(const CorotationalBody& body,
                                                   const Eigen::VectorXd& load_n, std::vector<Tool> tools,
                                                   const ContactOptions& options)
    : body_(body),
      load_n_(load_n),
      tools_(std::move(tools)),
      options_(options),
      surface_(body.linear()),
      holder_of_(body.linear().mesh().nodes.size(), kNobody) {
  check_tools(tools_);
  if (load_n_.size() != first_row(holder_of_.size())) {
    throw UsageError("the load has " + std::to_string(load_n_.size()) + " components, the body " +
                     std::to_string(3 * holder_of_.size()));
  }
  state_.poses.resize(tools_.size());
  state_.displacement_m = body_.solve(load_n_).displacement_m;
  state_.contact_n = Eigen::VectorXd::Zero(load_n_.size());
  const ContactSolver refuses_options_without_sense(
      neighbourhood({}, Eigen::MatrixXd(load_n_.size(), 0), surface_m(state_.displacement_m)), {}, options_);
  result_ = report(state_);
}

CorotationalManipulation::CorotationalManipulation(const CorotationalBody& body,
                                                   const Eigen::VectorXd& load_n,
                                                   const CorotationalManipulation& previous)
    : body_(body),
      load_n_(load_n),
      tools_(previous.tools_),
      options_(previous.options_),
      surface_(body.linear()),
      holder_of_(body.linear().mesh().nodes.size(), kNobody),
      state_(previous.state_),
      result_(previous.result_) {
  if (holder_of_.size() != previous.holder_of_.size()) {
    throw UsageError("a manipulation of " + std::to_string(previous.holder_of_.size()) +
                     " nodes cannot go on with a body of " + std::to_string(holder_of_.size()));
  }
  const auto touchable = [this](std::uint32_t node) {
    return surface_.place_of[node] != TouchableSurface::kNowhere;
  };
  for (const Hold& hold : previous.holds_) {
    Hold kept{hold.tool, hold.pose, {}, {}};
    for (std::size_t i = 0; i < hold.nodes.size(); ++i) {
      if (!touchable(hold.nodes[i])) continue;
      kept.nodes.push_back(hold.nodes[i]);
      kept.positions_m.push_back(hold.positions_m[i]);
      holder_of_[hold.nodes[i]] = hold.tool;
    }
    if (!kept.nodes.empty()) holds_.push_back(std::move(kept));
  }
  std::erase_if(result_.bound, [this](const BoundNode& bound) { return holder_of_[bound.node] == kNobody; });
  state_.displacement_m = carried_over_m(previous);
  // Contacts are found anew where a node that was pressed is no longer there.
  const bool all_there =
      std::ranges::all_of(result_.contacts, [&](const Contact& contact) { return touchable(contact.node); });
  if (!all_there) {
    state_.solver.reset();
    state_.pressing.clear();
    state_.contact_n.setZero();
    result_.contacts.clear();
  }
  severed_n_ =
      where_free(body_.inner_force_n(state_.displacement_m) - load_n_ - state_.contact_n, free_now());
  const std::vector<OptionalPose> poses = state_.poses;
  step(poses);
  severed_n_.resize(0);
}

/// Where the nodes are, (3 |V|): what the cut has moved lies where the tissue there lay.
Eigen::VectorXd CorotationalManipulation::carried_over_m(const CorotationalManipulation& previous) const {
  const TetMesh &now = body_.linear().mesh(), &before = previous.body_.linear().mesh();
  const Eigen::VectorXd& before_m = previous.state_.displacement_m;
  const std::vector<bool> used = nodes_in_use(now);
  Eigen::VectorXd carried_m = before_m;
  for (std::size_t node = 0; node < now.nodes.size(); ++node) {
    // What has lost its last element, or has fallen off, is back at rest.
    if (!used[node]) carried_m.segment<3>(first_row(node)).setZero();
    if (!used[node] || now.nodes[node] == before.nodes[node]) continue;
    for (const Tetrahedron& corners : before.tetrahedra) {
      Eigen::Matrix3d sides, moved;
      const auto of = [&](std::size_t corner) -> Vector3 {
        return before_m.segment<3>(first_row(corners[corner]));
      };
      for (Eigen::Index i = 0; i < 3; ++i) {
        const auto corner = static_cast<std::size_t>(i) + 1;
        sides.col(i) = before.nodes[corners[corner]] - before.nodes[corners[0]];
        moved.col(i) = of(corner) - of(0);
      }
      const Vector3 weights = sides.inverse() * (now.nodes[node] - before.nodes[corners[0]]);
      if (weights.minCoeff() < -kOnFace || weights.sum() > 1 + kOnFace) continue;
      carried_m.segment<3>(first_row(node)) = of(0) + moved * weights;
      break;
    }
  }
  return carried_m;
}

Vector3 CorotationalManipulation::position_m(std::uint32_t node,
                                             const Eigen::VectorXd& displacement_m) const {
  return body_.linear().mesh().nodes[node] + displacement_m.segment<3>(first_row(node));
}

Eigen::VectorXd CorotationalManipulation::surface_m(const Eigen::VectorXd& displacement_m) const {
  Eigen::VectorXd positions_m(first_row(surface_.nodes.size()));
  for (std::size_t place = 0; place < surface_.nodes.size(); ++place)
    positions_m.segment<3>(first_row(place)) = position_m(surface_.nodes[place], displacement_m);
  return positions_m;
}

std::size_t CorotationalManipulation::held_by(std::size_t tool) const {
  (void)known_tool(tools_, tool);
  const auto found = std::ranges::find(holds_, tool, &Hold::tool);
  return found == holds_.end() ? 0 : found->nodes.size();
}

std::size_t CorotationalManipulation::grasp(std::size_t tool, const Pose& pose) {
  const Tool& grasping = known_tool(tools_, tool);
  check_grasp(grasping, held_by(tool));
  const Pose there = sound_pose(pose, grasping.name);
  Hold hold{static_cast<std::uint32_t>(tool), there, {}, {}};
  std::vector<GraspCandidate> candidates;
  using enum GraspCandidate::State;
  for (const std::uint32_t node : surface_.nodes) {
    const Vector3 here_m = position_m(node, state_.displacement_m);
    const bool held = holder_of_[node] != kNobody;
    candidates.push_back({node, here_m, held ? kHeld : kFree});
    if (held || distance_to(grasping.shape, there.to_tool(here_m)).distance_m > 0) continue;
    hold.nodes.push_back(node);
    hold.positions_m.push_back(here_m);
  }
  if (hold.nodes.empty()) {
    for (std::uint32_t node = 0; node < holder_of_.size(); ++node) {
      if (body_.linear().free_components(node) == 0)
        candidates.push_back({node, position_m(node, state_.displacement_m), kFixed});
    }
    throw Error(grasp_refusal(grasping, there, candidates));
  }
  holds_.push_back(std::move(hold));
  for (const std::uint32_t node : holds_.back().nodes) holder_of_[node] = holds_.back().tool;
  state_.poses[tool] = there;
  return holds_.back().nodes.size();
}

void CorotationalManipulation::release(std::size_t tool) {
  if (held_by(tool) == 0) throw Error(known_tool(tools_, tool).name + " holds nothing that it could release");
  const auto found = std::ranges::find(holds_, tool, &Hold::tool);
  for (const std::uint32_t node : found->nodes) holder_of_[node] = kNobody;
  holds_.erase(found);
}

/// A part of the way from the last step's poses; tools that come are there at once.
std::vector<OptionalPose> CorotationalManipulation::poses_between(std::span<const OptionalPose> to,
                                                                  double part) const {
  std::vector<OptionalPose> poses(to.begin(), to.end());
  for (std::size_t tool = 0; tool < poses.size(); ++tool) {
    const OptionalPose& from = state_.poses[tool];
    if (part == 1 || !from || !poses[tool]) continue;
    poses[tool]->position_m = from->position_m + part * (to[tool]->position_m - from->position_m);
    poses[tool]->orientation = from->orientation.slerp(part, to[tool]->orientation).normalized();
  }
  return poses;
}

/// What no tool prescribes, (3 |V|).
std::vector<bool> CorotationalManipulation::free_now() const {
  std::vector<bool> free = body_.linear().free();
  for (const Hold& hold : holds_) {
    for (const std::uint32_t node : hold.nodes) {
      for (std::size_t component = 0; component < 3; ++component)
        free[3 * std::size_t{node} + component] = false;
    }
  }
  return free;
}

/// What tools did that have let go since or are taken away, and what elements bore that a cut took out,
/// (3 |V|): it is taken back bit by bit where the body would otherwise jump too far.
Eigen::VectorXd CorotationalManipulation::fading_n(std::span<const OptionalPose> poses) const {
  Eigen::VectorXd force_n = Eigen::VectorXd::Zero(load_n_.size());
  for (const BoundNode& bound : result_.bound) {
    if (holder_of_[bound.node] == kNobody) force_n.segment<3>(first_row(bound.node)) += bound.force_n;
  }
  for (const Contact& contact : result_.contacts) {
    if (!poses[contact.tool] && holder_of_[contact.node] == kNobody)
      force_n.segment<3>(first_row(contact.node)) += contact.force_n;
  }
  if (severed_n_.size() != 0) force_n += severed_n_;
  return force_n;
}

/// How held nodes still have to move, (3 |V|).
Eigen::VectorXd CorotationalManipulation::pulled_m(const State& from,
                                                   std::span<const OptionalPose> poses) const {
  Eigen::VectorXd pulled_m = Eigen::VectorXd::Zero(load_n_.size());
  for (const Hold& hold : holds_) {
    for (std::size_t i = 0; i < hold.nodes.size(); ++i) {
      const std::uint32_t node = hold.nodes[i];
      const Vector3 to_m = poses[hold.tool]->from_tool(hold.pose.to_tool(hold.positions_m[i]));
      pulled_m.segment<3>(first_row(node)) = to_m - position_m(node, from.displacement_m);
    }
  }
  // Components that are fixed stay so.
  return where_free(std::move(pulled_m), body_.linear().free());
}

std::unique_ptr<CorotationalManipulation::Tangent> CorotationalManipulation::tangent(
    const Eigen::VectorXd& displacement_m, const std::vector<bool>& free, Curvature curvature) {
  try {
    ++factorisations_;
    return std::make_unique<Tangent>(body_.stiffness(displacement_m, curvature), free,
                                     body_.linear().order());
  } catch (const Error&) {
    // Not positive definite: the body would rather be elsewhere; the convex curvature says which way.
    return curvature == Curvature::kExact ? tangent(displacement_m, free, Curvature::kConvex) : nullptr;
  }
}

CorotationalManipulation::Solids CorotationalManipulation::solids(std::span<const OptionalPose> poses,
                                                                  const State& state) const {
  Solids all;
  for (std::uint32_t tool = 0; tool < tools_.size(); ++tool) {
    const Tool& solid = tools_[tool];
    if (solid.action == ToolAction::kBinds || !poses[tool]) continue;
    const auto found = std::ranges::find(state.pressing, tool);
    all.before.push_back(static_cast<std::uint32_t>(found - state.pressing.begin()));
    all.tools.push_back(tool);
    all.shapes.push_back({solid.name, solid.shape, solid.action == ToolAction::kSticks, solid.friction});
    all.poses.push_back(*poses[tool]);
  }
  return all;
}

std::shared_ptr<ContactNeighbourhood> CorotationalManipulation::neighbourhood(
    const std::vector<std::uint32_t>& places, const Eigen::MatrixXd& columns,
    const Eigen::VectorXd& rest_m) const {
  auto made = std::make_shared<ContactNeighbourhood>();
  made->size_m = surface_.size_m;
  made->rest_m.resize(first_row(places.size()));
  made->compliance.resize(first_row(places.size()), first_row(places.size()));
  for (std::size_t i = 0; i < places.size(); ++i) {
    made->nodes.push_back(surface_.nodes[places[i]]);
    made->area_m2.push_back(surface_.area_m2[places[i]]);
    made->free.push_back(surface_.free[places[i]]);
    made->rest_m.segment<3>(first_row(i)) = rest_m.segment<3>(first_row(places[i]));
  }
  for (std::size_t j = 0; j < places.size(); ++j) {
    // Only what is below the diagonal is taken, and mirrored, so that the matrix is symmetric to the bit.
    for (std::size_t i = j; i < places.size(); ++i) {
      Eigen::Matrix3d block = columns.block<3, 3>(first_row(made->nodes[i]), first_row(j));
      if (i == j) block = (block + block.transpose().eval()) / 2;
      made->compliance.block<3, 3>(first_row(i), first_row(j)) = block;
      made->compliance.block<3, 3>(first_row(j), first_row(i)) = block.transpose();
    }
  }
  return made;
}

/// Adds to `step_m`, which is how the body would move if nothing pressed, what pressing does; the state's
/// contacts become those after the step.
void CorotationalManipulation::press(const Tangent& tangent, const Solids& solids, State& state,
                                     Eigen::VectorXd& step_m) const {
  state.contact_n.setZero();
  if (solids.tools.empty()) {
    state.solver.reset();
    state.pressing.clear();
    return;
  }
  std::vector<std::uint8_t> near(surface_.nodes.size());
  for (std::size_t place = 0; place < near.size(); ++place)
    near[place] = holder_of_[surface_.nodes[place]] == kNobody ? 0 : 1;  // never found
  PointTree tree(near.size());
  const auto mark = [&](const Eigen::VectorXd& positions_m, double margin_m) {
    tree.refit(positions_m);
    return mark_near(tree, positions_m, solids.shapes, solids.poses, margin_m, near);
  };
  mark(surface_m(state.displacement_m), kCorotationalMargin * surface_.size_m);
  if (state.solver) {
    for (const Contact& contact : state.solver->result().contacts) near[surface_.place_of[contact.node]] = 1;
  }
  const Eigen::VectorXd rest_m = surface_m(state.displacement_m + step_m);
  std::vector<std::uint32_t> before = solids.before;
  while (true) {
    std::vector<std::uint32_t> places;
    for (std::uint32_t place = 0; place < near.size(); ++place) {
      if (near[place] != 0 && holder_of_[surface_.nodes[place]] == kNobody) places.push_back(place);
    }
    Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(load_n_.size(), first_row(places.size()));
    for (std::size_t i = 0; i < places.size(); ++i)
      columns.block<3, 3>(first_row(surface_.nodes[places[i]]), first_row(i)).setIdentity();
    if (!places.empty()) tangent.factor.solve_columns(columns);
    auto solver =
        std::make_shared<ContactSolver>(neighbourhood(places, columns, rest_m), solids.shapes, options_);
    if (state.solver) solver->continue_from(*state.solver, before);
    const ContactResult& found = solver->step(solids.poses);
    Eigen::VectorXd pressed_m = step_m;
    for (const Contact& contact : found.contacts) {
      const auto i = std::ranges::find(solver->neighbourhood().nodes, contact.node) -
                     solver->neighbourhood().nodes.begin();
      pressed_m += columns.middleCols<3>(3 * i).lazyProduct(contact.force_n);
    }
    state.solver = solver;
    const Eigen::VectorXd positions_m = surface_m(state.displacement_m + pressed_m);
    if (!mark(positions_m, -options_.tolerance * surface_.size_m)) {
      for (const Contact& contact : found.contacts)
        state.contact_n.segment<3>(first_row(contact.node)) += contact.force_n;
      state.pressing = solids.tools;
      step_m = std::move(pressed_m);
      return;
    }
    // Tissue was pushed into a tool outside of what was looked at.
    mark(positions_m, kCorotationalMargin * surface_.size_m);
    for (std::uint32_t tool = 0; tool < before.size(); ++tool) before[tool] = tool;
  }
}

/// From one equilibrium to that with the tools at these poses and under these forces; false where none is
/// found.
bool CorotationalManipulation::converge(std::span<const OptionalPose> poses, const Eigen::VectorXd& force_n,
                                        const std::vector<bool>& free, State& state) {
  Eigen::VectorXd moved_m = pulled_m(state, poses);
  const auto left_n = [&](const State& now, double& largest_n) {
    const Eigen::VectorXd inner_n = body_.inner_force_n(now.displacement_m);
    largest_n = std::max({largest(inner_n), largest(force_n), largest(now.contact_n)});
    return where_free(force_n + now.contact_n - inner_n, free);
  };
  double largest_n = 0;
  Eigen::VectorXd unbalanced_n = left_n(state, largest_n);
  // Contacts and places belong together: at first where nothing has moved, later after a whole step.
  bool whole =
      same_poses(poses, state.poses) && largest(moved_m) <= kHoldRounding * surface_.size_m &&
      std::ranges::none_of(result_.contacts,
                           [this](const Contact& contact) { return holder_of_[contact.node] != kNobody; }) &&
      // Solids passed through what was held: they may be inside of what is no more.
      std::ranges::none_of(result_.bound,
                           [this](const BoundNode& bound) { return holder_of_[bound.node] == kNobody; });
  state.poses.assign(poses.begin(), poses.end());
  for (int i = 0; i < kMostNewtonSteps && unbalanced_n.allFinite(); ++i) {
    if (whole && largest(unbalanced_n) <= body_.tolerance_n(largest_n))
      return !body_.any_inverted(state.displacement_m);
    const auto there = tangent(state.displacement_m, free, Curvature::kExact);
    if (!there) return false;
    const Eigen::VectorXd pushed_n = where_free(force_n - body_.inner_force_n(state.displacement_m), free);
    Eigen::VectorXd step_m = moved_m + there->factor.solve(pushed_n - there->stiffness * moved_m);
    if (!step_m.allFinite()) return false;
    press(*there, solids(poses, state), state, step_m);
    if (!step_m.allFinite()) return false;
    const Eigen::VectorXd from_m = state.displacement_m;
    const double before_n = unbalanced_n.norm();
    if (i == 0) {
      // Brings tools to where they are to be; from there on it goes downhill.
      state.displacement_m += step_m;
      unbalanced_n = left_n(state, largest_n);
      moved_m.setZero();
      whole = true;
      continue;
    }
    const double slope_j = pushed_n.dot(step_m);
    const double energy_j = body_.energy_j(from_m) - force_n.dot(from_m);
    double part = 1;
    int halved = 0;
    for (; halved < kMostStepHalvings; ++halved, part /= 2) {
      state.displacement_m = from_m + part * step_m;
      unbalanced_n = left_n(state, largest_n);
      if (unbalanced_n.norm() <= before_n / 2) break;
      if (body_.energy_j(state.displacement_m) - force_n.dot(state.displacement_m) <=
          energy_j - kSufficientDecrease * part * slope_j) {
        break;
      }
    }
    if (halved == kMostStepHalvings) return false;
    whole = halved == 0;
  }
  return false;
}

const ManipulationResult& CorotationalManipulation::step(std::span<const OptionalPose> given) {
  std::vector<std::size_t> held(tools_.size());
  for (std::size_t tool = 0; tool < held.size(); ++tool) held[tool] = held_by(tool);
  const std::vector<OptionalPose> poses = sound_poses(tools_, given, held);
  const std::vector<bool> free = free_now();
  const Eigen::VectorXd fading = fading_n(poses);
  factorisations_ = 0;
  State reached_state = state_;
  double reached = 0;  // of the motion
  for (double part = 1; reached < 1;) {
    const double next = std::min(1.0, reached + part);
    State tried = reached_state;
    if (converge(poses_between(poses, next), load_n_ + (1 - next) * fading, free, tried)) {
      reached_state = std::move(tried);
      reached = next;
      part *= 2;
      continue;
    }
    part /= 2;
    if (part < kSmallestPart) {
      throw Error("no equilibrium is found beyond " + number_text(100 * reached, 2) +
                  " % of the motion: further on the tissue buckles or is crushed; move less far, or take a "
                  "smaller time step");
    }
  }
  ManipulationResult result = report(reached_state);
  state_ = std::move(reached_state);
  result_ = std::move(result);
  return result_;
}

ManipulationResult CorotationalManipulation::report(const State& state) const {
  ManipulationResult result;
  result.tools.resize(tools_.size());
  if (state.solver) {
    const ContactResult& contact = state.solver->result();
    result.contacts = contact.contacts;
    for (Contact& one : result.contacts) one.tool = state.pressing[one.tool];
    for (std::size_t i = 0; i < state.pressing.size(); ++i)
      result.tools[state.pressing[i]] = contact.tools[i];
    result.converged = contact.converged;
    result.iterations = contact.iterations;
    result.deepest_penetration_m = contact.deepest_penetration_m;
    result.largest_gap_m = contact.largest_gap_m;
  }
  const Eigen::VectorXd held_n =
      where_free(body_.inner_force_n(state.displacement_m) - load_n_, body_.linear().free());
  for (std::uint32_t node = 0; node < holder_of_.size(); ++node) {
    if (holder_of_[node] == kNobody) continue;
    result.bound.push_back({node, holder_of_[node], held_n.segment<3>(first_row(node))});
    const BoundNode& held = result.bound.back();
    ToolForce& tool = result.tools[held.tool];
    const Vector3 from_tool_m = position_m(node, state.displacement_m) - state.poses[held.tool]->position_m;
    ++tool.nodes;
    tool.force_n -= held.force_n;
    tool.torque_nm -= from_tool_m.cross(held.force_n);
  }
  std::ranges::stable_sort(result.bound, {}, &BoundNode::tool);
  for (const ToolForce& tool : result.tools) result.wrist_force_n += tool.force_n;
  if (!state.displacement_m.allFinite() || !result.wrist_force_n.allFinite())
    throw Error("what the tools do to the body is not finite: a pose is out of all proportion");
  return result;
}

Eigen::VectorXd CorotationalManipulation::tool_force_n() const {
  Eigen::VectorXd force_n = state_.contact_n;
  for (const BoundNode& held : result_.bound) force_n.segment<3>(first_row(held.node)) += held.force_n;
  return force_n;
}

}  // namespace kiroku::sim

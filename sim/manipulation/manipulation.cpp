#include "sim/manipulation/manipulation.h"

#include <algorithm>
#include <string>
#include <utility>

#include "base/error.h"
#include "sim/contact/near_tools.h"
#include "sim/mesh/degrees_of_freedom.h"

namespace kiroku::sim {
namespace {

/// How far around tools that press nodes are taken together, in lengths of the body, so that it is seldom
/// asked anew for their compliance.
constexpr double kElasticMargin = 0.02;

}  // namespace

Manipulation::Manipulation(const ContactBody& body, std::vector<Tool> tools, const ContactOptions& options)
    : body_(body),
      tools_(std::move(tools)),
      options_(options),
      size_m_(body.neighbourhood({})->size_m),
      bound_(body),
      poses_(tools_.size()),
      near_(body.surface().size()),
      surface_m_(first_row(body.surface().size())),
      tree_(body.surface().size()) {
  check_tools(tools_);
  const ContactSolver refuses_options_without_sense(body_.neighbourhood({}), {}, options_);
  step(poses_);
}

Manipulation::Manipulation(const ContactBody& body, const Manipulation& previous)
    : Manipulation(body, previous.tools_, previous.options_) {
  const std::size_t nodes = body_.body().mesh().nodes.size();
  const std::size_t nodes_before = previous.body_.body().mesh().nodes.size();
  if (nodes != nodes_before) {
    throw UsageError("a manipulation of " + nodes_text(nodes_before) + " cannot go on with a body of " +
                     std::to_string(nodes));
  }
  // Where the tissue lay on the tools tells what sticks to them.
  const Eigen::VectorXd displacement_m = previous.displacement_m();
  std::vector<std::uint8_t> bindable(nodes);
  for (const std::uint32_t node : body_.surface()) {
    bindable[node] = 1;
    pressed_.displacement_m.segment<3>(row_of(node)) = displacement_m.segment<3>(first_row(node));
  }
  for (const BoundNodes::Hold& hold : previous.bound_.holds()) {
    BoundNodes::Hold kept{hold.tool, hold.pose, {}, {}, hold.floats};
    for (std::size_t i = 0; i < hold.nodes.size(); ++i) {
      if (bindable[hold.nodes[i]] == 0) continue;
      kept.nodes.push_back(hold.nodes[i]);
      kept.displacements_m.push_back(hold.displacements_m[i]);
    }
    if (!kept.nodes.empty() && (!kept.floats || BoundNodes::span_a_plane(places_of(kept))))
      bound_.bind(std::move(kept));
  }
  bound_changed_ = true;
  if (previous.pressed_.solver) {
    pressed_.solver = std::make_unique<ContactSolver>(*previous.pressed_.solver);
    pressed_.tools = previous.pressed_.tools;
  }
  step(previous.poses_);
}

Manipulation::Manipulation(const Manipulation& other)
    : body_(other.body_),
      tools_(other.tools_),
      options_(other.options_),
      size_m_(other.size_m_),
      bound_(other.bound_),
      bound_changed_(other.bound_changed_),
      poses_(other.poses_),
      pressed_{other.pressed_.solver ? std::make_unique<ContactSolver>(*other.pressed_.solver) : nullptr,
               other.pressed_.tools, other.pressed_.displacement_m},
      result_(other.result_),
      near_(other.near_),
      surface_m_(other.surface_m_),
      tree_(other.tree_) {}

Eigen::Index Manipulation::row_of(std::uint32_t node) const {
  return first_row(body_.compliance().row_of(node));
}

Vector3 Manipulation::position_m(std::uint32_t node, const Eigen::VectorXd& displacement_m) const {
  return body_.body().mesh().nodes[node] + displacement_m.segment<3>(row_of(node));
}

std::size_t Manipulation::held_by(std::size_t tool) const {
  (void)known_tool(tools_, tool);
  return bound_.held_by(static_cast<std::uint32_t>(tool));
}

std::size_t Manipulation::grasp(std::size_t tool, const Pose& pose) {
  const Tool& grasping = known_tool(tools_, tool);
  check_grasp(grasping, held_by(tool));
  const Pose there = sound_pose(pose, grasping.name);
  BoundNodes::Hold hold{static_cast<std::uint32_t>(tool), there, {}, {}, false};
  for (const std::uint32_t node : body_.surface()) {
    const Vector3 here_m = position_m(node, pressed_.displacement_m);
    if (bound_.bound(node) || distance_to(grasping.shape, there.to_tool(here_m)).distance_m > 0) continue;
    hold.nodes.push_back(node);
    hold.displacements_m.emplace_back(pressed_.displacement_m.segment<3>(row_of(node)));
  }
  if (hold.nodes.empty()) refuse_grasp(grasping, there);
  const std::size_t count = hold.nodes.size();
  BoundNodes with = bound_;
  with.bind(std::move(hold));
  bound_ = std::move(with);
  bound_changed_ = true;
  poses_[tool] = there;
  return count;
}

void Manipulation::refuse_grasp(const Tool& tool, const Pose& pose) const {
  std::vector<GraspCandidate> candidates;
  using enum GraspCandidate::State;
  for (const std::uint32_t node : body_.surface()) {
    candidates.push_back(
        {node, position_m(node, pressed_.displacement_m), bound_.bound(node) ? kHeld : kFree});
  }
  for (std::uint32_t node = 0; node < body_.body().mesh().nodes.size(); ++node) {
    if (body_.body().free_components(node) == 0)
      candidates.push_back({node, body_.rest_m().segment<3>(first_row(node)), kFixed});
  }
  throw Error(grasp_refusal(tool, pose, candidates));
}

std::vector<Vector3> Manipulation::places_of(const BoundNodes::Hold& hold) const {
  std::vector<Vector3> places_m;
  for (std::size_t i = 0; i < hold.nodes.size(); ++i)
    places_m.push_back(body_.body().mesh().nodes[hold.nodes[i]] + hold.displacements_m[i]);
  return places_m;
}

std::size_t Manipulation::leave(std::size_t jaw, std::size_t other_jaw) {
  BoundNodes::Hold hold;
  hold.tool = static_cast<std::uint32_t>(jaw);
  hold.floats = true;
  hold.pose.position_m.setZero();
  const Vector3 to_other_m = poses_[jaw] && poses_[other_jaw]
                                 ? Vector3(poses_[other_jaw]->position_m - poses_[jaw]->position_m)
                                 : Vector3::Zero();
  for (const std::size_t tool : {jaw, other_jaw}) {
    const Tool& one = known_tool(tools_, tool);
    if (one.action != ToolAction::kSticks)
      throw UsageError(one.name + " is no jaw of a clip: it does not stick");
    const std::size_t before = hold.nodes.size();
    for (const Contact& contact : result_.contacts) {
      if (contact.tool != tool || !presses_with_face(contact, tool == jaw ? to_other_m : -to_other_m))
        continue;
      constexpr std::size_t kAllAxes = 3;
      if (body_.body().free_components(contact.node) < kAllAxes) {
        throw Error(one.name + " presses tissue that is fixed along an axis: a clip there could not move " +
                    "with what it holds; place it elsewhere");
      }
      hold.nodes.push_back(contact.node);
      hold.displacements_m.emplace_back(pressed_.displacement_m.segment<3>(row_of(contact.node)));
    }
    if (hold.nodes.size() == before) throw Error(one.name + " presses no tissue that it could hold");
    hold.pose.position_m += poses_[tool]->position_m / 2;
    hold.pose.orientation = poses_[tool]->orientation;
  }
  if (!BoundNodes::span_a_plane(places_of(hold))) {
    throw Error("the " + nodes_text(hold.nodes.size()) + " between " + tools_[jaw].name + " and " +
                tools_[other_jaw].name + " are on one line: take a finer mesh, or wider jaws");
  }
  const std::size_t count = hold.nodes.size();
  BoundNodes with = bound_;
  with.bind(std::move(hold));
  bound_ = std::move(with);
  bound_changed_ = true;
  poses_[jaw].reset();
  poses_[other_jaw].reset();
  return count;
}

Pose Manipulation::floating_pose(std::size_t tool) const {
  const auto number = static_cast<std::uint32_t>(tool);
  if (!bound_.floats(number)) throw UsageError(known_tool(tools_, tool).name + " was not left as a clip");
  return bound_.floating_pose(number, pressed_.displacement_m);
}

void Manipulation::release(std::size_t tool) {
  if (held_by(tool) == 0) throw Error(known_tool(tools_, tool).name + " holds nothing that it could release");
  BoundNodes without = bound_;
  without.release(static_cast<std::uint32_t>(tool));
  bound_ = std::move(without);
  bound_changed_ = true;
}

std::vector<OptionalPose> Manipulation::checked(std::span<const OptionalPose> poses) const {
  std::vector<std::size_t> held(tools_.size());
  for (std::size_t tool = 0; tool < held.size(); ++tool) {
    const bool left = bound_.floats(static_cast<std::uint32_t>(tool));
    if (left && tool < poses.size() && poses[tool])
      throw UsageError(tools_[tool].name + " was left as a clip: nothing moves it but the body");
    held[tool] = left ? 0 : held_by(tool);
  }
  return sound_poses(tools_, poses, held);
}

const ManipulationResult& Manipulation::step(std::span<const OptionalPose> poses) {
  std::vector<OptionalPose> now = checked(poses);
  Eigen::VectorXd untouched_m;
  bound_.displacement_m(now, untouched_m);
  if (!untouched_m.allFinite()) {
    throw Error("what the tools do to the body is not finite: a pose is out of all proportion");
  }
  Pressed pressed = press(now, std::move(untouched_m));
  ManipulationResult result = report(now, pressed);
  poses_ = std::move(now);
  pressed_ = std::move(pressed);
  result_ = std::move(result);
  bound_changed_ = false;
  return result_;
}

void Manipulation::look_at_surface(const Eigen::VectorXd& displacement_m) {
  const std::vector<std::uint32_t>& surface = body_.surface();
  for (std::size_t place = 0; place < surface.size(); ++place)
    surface_m_.segment<3>(first_row(place)) = position_m(surface[place], displacement_m);
  tree_.refit(surface_m_);
}

std::vector<std::uint32_t> Manipulation::places_near() const {
  std::vector<std::uint32_t> places;
  for (std::uint32_t place = 0; place < near_.size(); ++place) {
    if (near_[place] != 0 && !bound_.bound(body_.surface()[place])) places.push_back(place);
  }
  return places;
}

/// Contacts on the body as it is held, found among the nodes near tools; repeated with more of them until the
/// whole surface is clear of tools.
Manipulation::Pressed Manipulation::press(std::span<const OptionalPose> poses, Eigen::VectorXd untouched_m) {
  Pressed next;
  std::vector<ContactTool> solids;
  std::vector<Pose> there;
  std::vector<std::uint32_t> before;  // which of the tools of the last step each is
  for (std::uint32_t tool = 0; tool < tools_.size(); ++tool) {
    const Tool& solid = tools_[tool];
    if (solid.action == ToolAction::kBinds || !poses[tool]) continue;
    next.tools.push_back(tool);
    solids.push_back({solid.name, solid.shape, solid.action == ToolAction::kSticks, solid.friction});
    there.push_back(*poses[tool]);
    const auto found = std::ranges::find(pressed_.tools, tool);
    before.push_back(static_cast<std::uint32_t>(found - pressed_.tools.begin()));
  }
  if (solids.empty()) {
    next.displacement_m = std::move(untouched_m);
    return next;
  }
  const auto mark = [&](double margin_m) {
    return mark_near(tree_, surface_m_, solids, there, margin_m, near_);
  };
  // Bound nodes are marked too, so that they are never found.
  const auto forget = [&] {
    for (std::size_t place = 0; place < near_.size(); ++place)
      near_[place] = bound_.bound(body_.surface()[place]) ? 1 : 0;
  };
  look_at_surface(pressed_.displacement_m);
  const ContactSolver* last = pressed_.solver.get();
  bool anew = last == nullptr || bound_changed_ || next.tools != pressed_.tools;
  forget();
  if (!anew) {
    for (const std::uint32_t node : last->neighbourhood().nodes) near_[body_.place_of(node)] = 1;
    anew = mark(kElasticMargin * size_m_);
  }
  if (anew) {
    // What was left behind is forgotten; what presses stays.
    forget();
    mark(kElasticMargin * size_m_);
    for (const Contact& contact : result_.contacts) near_[body_.place_of(contact.node)] = 1;
  }
  while (true) {
    std::unique_ptr<ContactSolver> solver;
    if (anew) {
      solver = std::make_unique<ContactSolver>(bound_.neighbourhood(places_near()), solids, options_);
      if (last != nullptr) solver->continue_from(*last, before);
    } else {
      solver = std::make_unique<ContactSolver>(*last);
    }
    const std::vector<std::uint32_t>& nodes = solver->neighbourhood().nodes;
    Eigen::VectorXd rest_m(first_row(nodes.size()));
    for (std::size_t point = 0; point < nodes.size(); ++point)
      rest_m.segment<3>(first_row(point)) = position_m(nodes[point], untouched_m);
    solver->rest_at(std::move(rest_m));
    solver->step(there);
    next.displacement_m = untouched_m;
    bound_.add_contacts(solver->result().contacts, next.displacement_m);
    next.solver = std::move(solver);
    look_at_surface(next.displacement_m);
    if (!mark(-options_.tolerance * size_m_)) return next;
    // Tissue was pushed into a tool outside the neighbourhood, which only grows from here.
    mark(kElasticMargin * size_m_);
    anew = true;
    last = next.solver.get();
    for (std::uint32_t tool = 0; tool < before.size(); ++tool) before[tool] = tool;
  }
}

ManipulationResult Manipulation::report(std::span<const OptionalPose> poses, const Pressed& pressed) const {
  ManipulationResult result;
  result.tools.resize(tools_.size());
  if (pressed.solver) {
    const ContactResult& contact = pressed.solver->result();
    result.contacts = contact.contacts;
    for (Contact& one : result.contacts) one.tool = pressed.tools[one.tool];
    for (std::size_t i = 0; i < pressed.tools.size(); ++i) result.tools[pressed.tools[i]] = contact.tools[i];
    result.converged = contact.converged;
    result.iterations = contact.iterations;
    result.deepest_penetration_m = contact.deepest_penetration_m;
    result.largest_gap_m = contact.largest_gap_m;
  }
  result.bound = bound_.forces(poses, result.contacts);
  std::vector<Vector3> origins_m(tools_.size(), Vector3::Zero());
  for (std::uint32_t tool = 0; tool < tools_.size(); ++tool) {
    if (bound_.floats(tool)) {
      origins_m[tool] = bound_.floating_pose(tool, pressed.displacement_m).position_m;
    } else if (poses[tool]) {
      origins_m[tool] = poses[tool]->position_m;
    }
  }
  for (const BoundNode& held : result.bound) {
    ToolForce& tool = result.tools[held.tool];
    const Vector3 from_tool_m = position_m(held.node, pressed.displacement_m) - origins_m[held.tool];
    ++tool.nodes;
    tool.force_n -= held.force_n;
    tool.torque_nm -= from_tool_m.cross(held.force_n);
  }
  bool finite = pressed.displacement_m.allFinite();
  for (const ToolForce& tool : result.tools) {
    result.wrist_force_n += tool.force_n;
    finite = finite && tool.force_n.allFinite() && tool.torque_nm.allFinite();
  }
  if (!finite || !result.wrist_force_n.allFinite()) {
    throw Error("what the tools do to the body is not finite: a pose is out of all proportion");
  }
  return result;
}

Eigen::VectorXd Manipulation::displacement_m() const {
  if (body_.compliance().complete()) return pressed_.displacement_m;
  std::vector<Contact> all = result_.contacts;
  for (const BoundNode& held : result_.bound) {
    Contact& contact = all.emplace_back();
    contact.node = held.node;
    contact.force_n = held.force_n;
  }
  Eigen::VectorXd displacement_m;
  body_.displacement_m(all, displacement_m);
  return displacement_m;
}

Eigen::VectorXd Manipulation::tool_force_n() const {
  Eigen::VectorXd force_n = Eigen::VectorXd::Zero(first_row(body_.body().mesh().nodes.size()));
  for (const BoundNode& held : result_.bound) force_n.segment<3>(first_row(held.node)) += held.force_n;
  for (const Contact& contact : result_.contacts)
    force_n.segment<3>(first_row(contact.node)) += contact.force_n;
  return force_n;
}

}  // namespace kiroku::sim

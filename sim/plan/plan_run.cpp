#include "sim/plan/plan_run.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/cutting/rest_mapping.h"
#include "sim/mesh/length_unit.h"

namespace kiroku::sim {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
/// Of a time step: what is left by rounding when times are added up.
constexpr double kSameMoment = 1e-9;
/// Of a jaw's length: what slips further in a step slips, even where it is caught at an edge of the jaw, too.
constexpr double kFarAlongJaw = 0.1;
/// Jaws may come so deep into the tissue: what is left by rounding.
constexpr double kRoomM = 1e-6;

/// A time step further, and at the key frame that is there but for rounding.
double next_moment_s(const PlanStep& step, double local_s, double time_step_s) {
  const double next_s = std::min(local_s + time_step_s, step.duration_s);
  for (const PlanMotion& motion : step.motions) {
    const std::vector<KeyFrame>& frames = motion.path.frames();
    const auto frame =
        std::ranges::lower_bound(frames, next_s - kSameMoment * time_step_s, {}, &KeyFrame::at_s);
    if (frame != frames.end() && frame->at_s <= next_s + kSameMoment * time_step_s) return frame->at_s;
  }
  return next_s;
}

}  // namespace

PlanRun::PlanRun(const Plan& plan) : plan_(plan), mesh_(plan.body.mesh) {
  std::vector<Tool> tools;
  place_of_.resize(plan.tools.size());
  for (std::size_t tool = 0; tool < plan.tools.size(); ++tool) {
    if (plan.tools[tool].kind == ToolKind::kScalpel) continue;
    const PlanTool& one = plan.tools[tool];
    place_of_[tool] = tools.size();
    if (closes(one.kind)) {
      for (std::size_t which = 0; which < kJaws; ++which)
        tools.push_back(jaw(one.tool.name, which, one.jaw_half_extent_m(), one.tool.friction));
    } else {
      tools.push_back(one.tool);
    }
  }
  places_ = tools.size();
  body_ = plan_body(plan, std::move(tools));
  bears_.assign(mesh_.tetrahedra.size(), 1);
  frame_.poses.resize(plan.tools.size());
  frame_.tools.resize(plan.tools.size());
  frame_.grips.resize(plan.tools.size());
  on_jaws_m_.resize(plan.tools.size());
}

PlanRun::PlanRun(const PlanRun& other)
    : plan_(other.plan_),
      place_of_(other.place_of_),
      places_(other.places_),
      shape_(other.shape_),
      body_(other.body_->copy()),
      mesh_(other.mesh_),
      bears_(other.bears_),
      begun_(other.begun_),
      in_step_(other.in_step_),
      kept_open_(other.kept_open_),
      unbalanced_told_(other.unbalanced_told_),
      step_(other.step_),
      step_begins_s_(other.step_begins_s_),
      local_s_(other.local_s_),
      nearest_m_(other.nearest_m_),
      closes_from_m_(other.closes_from_m_),
      on_jaws_m_(other.on_jaws_m_),
      slip_told_(other.slip_told_),
      lost_told_(other.lost_told_),
      slipped_before_m_(other.slipped_before_m_),
      blade_rest_(other.blade_rest_),
      frame_(other.frame_),
      figures_(other.figures_) {}

PlanRun::~PlanRun() = default;

template <typename Do>
void PlanRun::at_step(Do what) {
  try {
    what();
  } catch (const Error& error) {
    const std::size_t failed = std::exchange(step_, plan_.steps.size());
    const PlanStep& step = plan_.steps[failed];
    throw Error(step.where + " (" + name_of(step.action) + "): " + error.what());
  }
}

bool PlanRun::next() {
  if (!begun_) {
    begun_ = true;
    balance();
    record();
    return true;
  }
  if (step_ == plan_.steps.size()) return false;
  const bool open = kept_open_ && step_ + 1 == plan_.steps.size();
  if (open && in_step_ && at_end()) return false;
  at_step([&] {
    if (!in_step_) begin_step();
    advance(next_moment_s(plan_.steps[step_], local_s_, plan_.time_step_s));
    record();
    if (at_end() && !open) finish_step();
  });
  return true;
}

void PlanRun::end_step() {
  kept_open_ = false;
  at_step([&] { finish_step(); });
}

bool PlanRun::at_end() const {
  return plan_.steps[step_].duration_s - local_s_ < kSameMoment * plan_.time_step_s;
}

void PlanRun::begin_step() {
  in_step_ = true;
  local_s_ = 0;
  frame_.step = step_;
  StepFigures& figures = figures_.emplace_back();
  figures.begins_s = step_begins_s_;
  figures.largest_force_n.resize(plan_.tools.size());
  figures.most_nodes.resize(plan_.tools.size());
  figures.largest_squeeze_n.resize(plan_.tools.size());
  figures.slipped_m.resize(plan_.tools.size());
  slipped_before_m_.clear();
  for (const PlanGrip& grip : frame_.grips) slipped_before_m_.push_back(grip.slipped_m);
  slip_told_.assign(plan_.tools.size(), 0);
  lost_told_.assign(plan_.tools.size(), 0);
  nearest_m_.assign(plan_.tools.size(), kNever);
  blade_rest_.reset();
  unbalanced_told_ = false;
  const PlanStep& step = plan_.steps[step_];
  for (const PlanMotion& motion : step.motions) {
    const bool comes = !frame_.poses[motion.tool];
    frame_.poses[motion.tool] = motion.path.at(0);
    if (step.action == PlanAction::kClose) {
      if (comes) {
        frame_.grips[motion.tool].opening_m = plan_.tools[motion.tool].opening_m;
        expect_room_for_jaws(motion.tool);
      }
      closes_from_m_ = frame_.grips[motion.tool].opening_m;
    }
    if (step.curve) show_blade(motion);
    if (step.action == PlanAction::kGrasp) body_->grasp(place_of_[motion.tool], *frame_.poses[motion.tool]);
  }
  for (const std::size_t tool : step.released) {
    if (stays(plan_.tools[tool].kind)) {
      leave(tool);
      continue;
    }
    if (binds(plan_.tools[tool].kind)) body_->release(place_of_[tool]);
    frame_.poses[tool].reset();
    frame_.grips[tool] = {};
    on_jaws_m_[tool].clear();
  }
}

/// Jaws come from outside: tissue that one of them comes to lie in would be pushed out any way.
void PlanRun::expect_room_for_jaws(std::size_t tool) const {
  const PlanTool& grasper = plan_.tools[tool];
  for (const Pose& there : jaw_poses(*frame_.poses[tool], grasper.jaw_half_extent_m(), grasper.opening_m)) {
    for (const std::uint32_t node : body_->surface()) {
      const Vector3 position_m = mesh_.nodes[node] + frame_.displacement_m.segment<3>(
                                                         static_cast<Eigen::Index>(3 * std::size_t{node}));
      const double inside_m = -distance_to(grasper.tool.shape, there.to_tool(position_m)).distance_m;
      if (inside_m <= kRoomM) continue;
      throw Error("'" + grasper.tool.name + "', open by " + number_text(grasper.opening_m * kMmPerM, 3) +
                  " mm, comes with a jaw in the tissue: node " + std::to_string(node) + " lies " +
                  number_text(inside_m * kMmPerM, 3) +
                  " mm deep in it; place it elsewhere, or let it open wider");
    }
  }
}

/// The applier leaves a clip, which stays.
void PlanRun::leave(std::size_t tool) {
  PlanGrip& grip = frame_.grips[tool];
  if (std::ranges::any_of(grip.grip.jaws, [](const ToolForce& jaw) { return jaw.nodes == 0; })) {
    throw Error("'" + plan_.tools[tool].tool.name +
                "' would be left with nothing between its jaws: close it further, or place it elsewhere");
  }
  body_->leave(place_of_[tool]);
  grip.left = true;
  on_jaws_m_[tool].clear();
}

void PlanRun::advance(double local_s) {
  const PlanStep& step = plan_.steps[step_];
  for (const PlanMotion& motion : step.motions) {
    if (step.action == PlanAction::kCut) cut(motion, local_s_, local_s);
    frame_.poses[motion.tool] = motion.path.at(local_s);
    if (step.action == PlanAction::kClose) {
      frame_.grips[motion.tool].opening_m =
          local_s >= step.duration_s
              ? step.opening_m
              : closes_from_m_ + (step.opening_m - closes_from_m_) * (local_s / step.duration_s);
    }
  }
  local_s_ = local_s;
  frame_.time_s = step_begins_s_ + local_s;
  balance();
  for (const PlanMotion& motion : step.motions) {
    if (step.curve) show_blade(motion);
  }
}

/// Where the organ, as it lies, has what is cut in the rest shape.
void PlanRun::show_blade(const PlanMotion& motion) {
  if (!shape_) shape_.emplace(plan_.body.mesh, plan_.body.constraints);
  const RestMapping mapping(shape_->geometry(), frame_.displacement_m);
  frame_.poses[motion.tool] = pose_of_blade(mapping.to_deformed(blade(motion, local_s_)));
}

void PlanRun::finish_step() {
  const PlanStep& step = plan_.steps[step_];
  const StepFigures& figures = figures_.back();
  for (const PlanMotion& motion : step.motions) {
    const PlanTool& tool = plan_.tools[motion.tool];
    if (step.action == PlanAction::kCut) {
      if (figures.tetrahedra_removed == 0)
        throw Error("'" + tool.tool.name + "' never meets the tissue: look at its path and its edge");
      frame_.poses[motion.tool].reset();
    } else if ((touches(tool.kind) ||
                (step.action == PlanAction::kClose && step.opening_m <= closes_from_m_)) &&
               figures.most_nodes[motion.tool] == 0) {
      throw Error("'" + tool.tool.name + "' never touches the tissue: the nearest it comes is " +
                  number_text(nearest_m_[motion.tool] * kMmPerM, 3) + " mm");
    }
  }
  step_begins_s_ += step.duration_s;
  ++step_;
  in_step_ = false;
}

BladePose PlanRun::blade(const PlanMotion& motion, double local_s) const {
  const Pose pose = motion.path.at(local_s);
  return {pose.position_m, pose.from_tool(Vector3(0, 0, plan_.tools[motion.tool].edge_m))};
}

void PlanRun::cut(const PlanMotion& motion, double from_s, double to_s) {
  if (!shape_) shape_.emplace(plan_.body.mesh, plan_.body.constraints);
  const RestMapping mapping(shape_->geometry(), frame_.displacement_m);
  const auto at_rest = [&](double local_s) {
    const BladePose there = blade(motion, local_s);
    return plan_.steps[step_].curve ? there : mapping.to_rest(there);
  };
  if (!blade_rest_) blade_rest_ = at_rest(from_s);
  const BladePose to = at_rest(to_s);
  const CutShape::Step done = shape_->cut(SweepSurface(*blade_rest_, to));
  blade_rest_ = to;
  StepFigures& figures = figures_.back();
  figures.tetrahedra_removed += done.cut.change.removed.size();
  figures.volume_lost_m3 += done.cut.volume_lost_m3;
  figures.remarks.insert(figures.remarks.end(), done.fallen.begin(), done.fallen.end());
  if (!done.changed()) return;
  mesh_ = shape_->geometry().remaining();
  bears_.clear();
  for (std::uint32_t t = 0; t < plan_.body.mesh.tetrahedra.size(); ++t) {
    if (shape_->geometry().present(t)) bears_.push_back(shape_->bears(t) ? 1 : 0);
  }
  body_ = body_->after_cut(shape_->bearing());
}

void PlanRun::balance() {
  std::vector<OptionalPose> poses(places_);
  for (std::size_t tool = 0; tool < plan_.tools.size(); ++tool) {
    const PlanTool& one = plan_.tools[tool];
    if (one.kind == ToolKind::kScalpel || !frame_.poses[tool] || frame_.grips[tool].left) continue;
    if (closes(one.kind)) {
      const auto jaws = jaw_poses(*frame_.poses[tool], one.jaw_half_extent_m(), frame_.grips[tool].opening_m);
      std::ranges::copy(jaws, poses.begin() + static_cast<std::ptrdiff_t>(place_of_[tool]));
    } else {
      poses[place_of_[tool]] = frame_.poses[tool];
    }
  }
  body_->step(poses);
  frame_.displacement_m = body_->displacement_m();
  while (let_go_of_clips(body_->result())) {
    body_->step(poses);
    frame_.displacement_m = body_->displacement_m();
  }
  const ManipulationResult& result = body_->result();
  for (std::size_t tool = 0; tool < plan_.tools.size(); ++tool) {
    const ToolKind kind = plan_.tools[tool].kind;
    if (kind == ToolKind::kScalpel) continue;
    frame_.tools[tool] = {};
    if (closes(kind)) {
      if (frame_.poses[tool] && !frame_.grips[tool].left) grip(tool, result);
      if (frame_.grips[tool].left)
        frame_.tools[tool] = felt_by(frame_.grips[tool].grip, *frame_.poses[tool],
                                     jaw_poses(*frame_.poses[tool], plan_.tools[tool].jaw_half_extent_m(),
                                               frame_.grips[tool].opening_m));
    } else {
      frame_.tools[tool] = result.tools[place_of_[tool]];
    }
  }
  frame_.tool_force_n = body_->tool_force_n();
  const std::vector<SymmetricTensor> bearing_pa = body_->stress_pa(frame_.displacement_m);
  frame_.stress_pa.assign(mesh_.tetrahedra.size(), SymmetricTensor::Zero());
  std::size_t next = 0;
  for (std::size_t t = 0; t < bears_.size(); ++t) {
    if (bears_[t] != 0) frame_.stress_pa[t] = bearing_pa[next++];
  }
}

/// Where a clip that was left is now, and how it holds.
void PlanRun::grip_left(std::size_t tool, const ManipulationResult& result) {
  const PlanTool& clip = plan_.tools[tool];
  PlanGrip& now = frame_.grips[tool];
  const Pose pose = body_->floating_pose(place_of_[tool]);
  frame_.poses[tool] = pose;
  std::vector<BoundNode> held;
  std::vector<Vector3> places_m;
  for (const BoundNode& bound : result.bound) {
    if (bound.tool != place_of_[tool]) continue;
    held.push_back(bound);
    places_m.push_back(mesh_.nodes[bound.node] + frame_.displacement_m.segment<3>(
                                                     static_cast<Eigen::Index>(3 * std::size_t{bound.node})));
  }
  now.grip = grip_of_left(held, places_m, pose, jaw_poses(pose, clip.jaw_half_extent_m(), now.opening_m),
                          clip.tool.friction);
}

/// Clips that were left come off where friction cannot hold what pulls along their jaws, or nothing presses
/// against these any more. True where one has.
bool PlanRun::let_go_of_clips(const ManipulationResult& result) {
  bool gone = false;
  for (std::size_t tool = 0; tool < plan_.tools.size(); ++tool) {
    if (!frame_.grips[tool].left) continue;
    const std::string named = "'" + plan_.tools[tool].tool.name + "'";
    const std::string at = "at " + number_text(frame_.time_s, 4) + " s ";
    const bool holds =
        std::ranges::any_of(result.bound, [&](const BoundNode& one) { return one.tool == place_of_[tool]; });
    if (holds) grip_left(tool, result);
    const Grip& grip = frame_.grips[tool].grip;
    // What lies on one jaw alone balances by itself: how firmly it is pressed would be rounding.
    if (holds && std::ranges::all_of(grip.jaws, [](const ToolForce& jaw) { return jaw.nodes > 0; })) {
      if (grip.squeeze_n > 0 && !slips(grip)) continue;
      figures_.back().remarks.push_back(
          at + named + " comes off and lets the tissue go: " + number_text(grip.pull_n, 3) +
          " N pull along its jaws, which press with " + number_text(grip.squeeze_n, 3) + " N each and hold " +
          number_text(grip.most_pull_n, 3) + " N at most");
      body_->release(place_of_[tool]);
    } else {
      figures_.back().remarks.push_back(at + named + " comes off: a cut has left too little of what it held");
      if (holds) body_->release(place_of_[tool]);
    }
    frame_.poses[tool].reset();
    frame_.grips[tool] = {};
    gone = true;
  }
  return gone;
}

/// What a grasper's jaws do now, and how far the tissue has slipped along them since the last frame: the mean
/// way of the nodes that lay on them then and lie on them now, so that what bulges to all sides cancels.
void PlanRun::grip(std::size_t tool, const ManipulationResult& result) {
  const PlanTool& grasper = plan_.tools[tool];
  const Pose& pose = *frame_.poses[tool];
  PlanGrip& now = frame_.grips[tool];
  const auto first = static_cast<std::uint32_t>(place_of_[tool]);
  const auto jaws = jaw_poses(pose, grasper.jaw_half_extent_m(), now.opening_m);
  now.grip = grip_of({result.tools[first], result.tools[first + 1]}, result.contacts, first, jaws,
                     grasper.tool.friction);
  frame_.tools[tool] = felt_by(now.grip, pose, jaws);
  std::map<std::uint32_t, Vector3> there_m;
  for (const Contact& contact : result.contacts) {
    if (!between_jaws(contact, first, jaws)) continue;
    there_m[contact.node] = pose.to_tool(
        mesh_.nodes[contact.node] +
        frame_.displacement_m.segment<3>(static_cast<Eigen::Index>(3 * std::size_t{contact.node})));
  }
  Eigen::Vector2d way_m = Eigen::Vector2d::Zero();
  std::size_t nodes = 0;
  for (const auto& [node, at_m] : there_m) {
    const auto before = on_jaws_m_[tool].find(node);
    if (before == on_jaws_m_[tool].end()) continue;
    way_m += (at_m - before->second).head<2>();
    ++nodes;
  }
  if (nodes > 0) now.slipped_m += way_m.norm() / static_cast<double>(nodes);
  on_jaws_m_[tool] = std::move(there_m);
}

/// Once a step and grasper; not while jaws close, when what they barely touch slides as it likes.
void PlanRun::tell_slips() {
  const PlanStep& step = plan_.steps[step_];
  StepFigures& figures = figures_.back();
  for (std::size_t tool = 0; tool < plan_.tools.size(); ++tool) {
    frame_.grips[tool].slips = false;
    const PlanTool& grasper = plan_.tools[tool];
    const bool own =
        std::ranges::any_of(step.motions, [&](const PlanMotion& one) { return one.tool == tool; });
    if (!closes(grasper.kind) || !frame_.poses[tool] || frame_.grips[tool].left ||
        (step.action == PlanAction::kClose && own))
      continue;
    const std::string at = "at " + number_text(frame_.time_s, 4) + " s ";
    const Grip& grip = frame_.grips[tool].grip;
    const double slipped_m = figures.slipped_m[tool];
    frame_.grips[tool].slips = slips(grip) || slipped_m > kFarAlongJaw * 2 * grasper.jaw_half_extent_m().x();
    if (frame_.grips[tool].slips && slip_told_[tool] == 0) {
      slip_told_[tool] = 1;
      figures.remarks.push_back(
          at + "the tissue slips in '" + grasper.tool.name + "', by " + number_text(slipped_m * kMmPerM, 2) +
          " mm so far: it pulls with " + number_text(grip.pull_n, 3) + " N, and jaws that press with " +
          number_text(grip.squeeze_n, 3) + " N each hold " + number_text(grip.most_pull_n, 3) + " N at most");
    }
    if (grip.squeeze_n == 0 && figures.largest_squeeze_n[tool] > 0 && lost_told_[tool] == 0) {
      lost_told_[tool] = 1;
      figures.remarks.push_back(at + "the tissue has slipped out of '" + grasper.tool.name + "'");
    }
  }
}

void PlanRun::record() {
  if (figures_.empty()) return;
  StepFigures& figures = figures_.back();
  const ManipulationResult& result = body_->result();
  ++figures.frames;
  for (Eigen::Index at = 0; at < frame_.displacement_m.size(); at += 3) {
    figures.largest_displacement_m =
        std::max(figures.largest_displacement_m, frame_.displacement_m.segment<3>(at).norm());
  }
  for (const SymmetricTensor& stress_pa : frame_.stress_pa)
    figures.largest_von_mises_pa = std::max(figures.largest_von_mises_pa, von_mises(stress_pa));
  for (std::size_t tool = 0; tool < plan_.tools.size(); ++tool) {
    const ToolForce& force = frame_.tools[tool];
    figures.largest_force_n[tool] = std::max(figures.largest_force_n[tool], force.force_n.norm());
    figures.most_nodes[tool] = std::max<std::size_t>(figures.most_nodes[tool], force.nodes);
    const PlanGrip& grip = frame_.grips[tool];
    figures.largest_squeeze_n[tool] = std::max(figures.largest_squeeze_n[tool], grip.grip.squeeze_n);
    figures.slipped_m[tool] = grip.slipped_m - slipped_before_m_[tool];
    const ToolKind kind = plan_.tools[tool].kind;
    if (frame_.poses[tool] && (touches(kind) || closes(kind)) && figures.most_nodes[tool] == 0)
      nearest_m_[tool] = std::min(nearest_m_[tool], distance_m(tool));
  }
  tell_slips();
  figures.deepest_penetration_m = std::max(figures.deepest_penetration_m, result.deepest_penetration_m);
  if (!result.converged && !std::exchange(unbalanced_told_, true)) {
    figures.remarks.push_back("at " + number_text(frame_.time_s, 4) + " s pressed nodes are up to " +
                              number_text(result.largest_gap_m * kMmPerM, 2) +
                              " mm off their tool: take a smaller time step");
  }
}

double PlanRun::distance_m(std::size_t tool) const {
  const PlanTool& one = plan_.tools[tool];
  std::vector<Pose> solids{*frame_.poses[tool]};
  if (closes(one.kind)) {
    const auto jaws = jaw_poses(solids.front(), one.jaw_half_extent_m(), frame_.grips[tool].opening_m);
    solids.assign(jaws.begin(), jaws.end());
  }
  double nearest_m = kNever;
  for (const std::uint32_t node : body_->surface()) {
    const Vector3 position_m = mesh_.nodes[node] + frame_.displacement_m.segment<3>(
                                                       static_cast<Eigen::Index>(3 * std::size_t{node}));
    for (const Pose& pose : solids)
      nearest_m = std::min(nearest_m, distance_to(one.tool.shape, pose.to_tool(position_m)).distance_m);
  }
  return nearest_m;
}

}  // namespace kiroku::sim

#include "sim/plan/plan_session.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/length_unit.h"
#include "sim/plan/written_pose.h"

namespace kiroku::sim {
namespace {

/// States before a step that are kept. After a cut a state has a factor of its own, the largest part of it.
constexpr std::size_t kMostKept = 32;
constexpr std::ptrdiff_t kMostCutsKept = 2;

}  // namespace

PlanSession::PlanSession(Plan plan, const std::function<void(double time_s)>& progress)
    : plan_(std::move(plan)), given_(plan_.steps.size()) {
  std::vector<PlanStep> steps = std::exchange(plan_.steps, {});
  run_ = std::make_unique<PlanRun>(plan_);
  run_->next();
  for (PlanStep& step : steps) {
    remember();
    plan_.steps.push_back(std::move(step));
    while (run_->next()) {
      if (progress) progress(run_->frame().time_s);
    }
  }
}

PlanSession::~PlanSession() = default;

void PlanSession::remember() {
  ++revision_;
  before_.push_back(std::make_unique<const PlanRun>(*run_));
  std::ptrdiff_t cuts = 0;
  for (std::size_t i = before_.size() - 1; i-- > 0;) {
    if (plan_.steps[i].action == PlanAction::kCut) ++cuts;
    if (cuts > kMostCutsKept || before_.size() - i > kMostKept) before_[i].reset();
  }
}

/// To before the last of the steps that were remembered, which the plan has no longer.
void PlanSession::go_back() {
  assert(before_.size() == plan_.steps.size() + 1);
  moving_ = false;
  std::size_t kept = before_.size() - 1;
  while (kept > 0 && !before_[kept]) --kept;
  run_ = before_[kept] ? std::make_unique<PlanRun>(*before_[kept]) : std::make_unique<PlanRun>(plan_);
  while (run_->next()) {
  }
  before_.pop_back();
}

PlanStep PlanSession::take_last() {
  ++revision_;
  PlanStep step = std::move(plan_.steps.back());
  plan_.steps.pop_back();
  return step;
}

void PlanSession::carry_out(PlanStep step) {
  remember();
  step.where = "steps[" + std::to_string(plan_.steps.size()) + "]";
  plan_.steps.push_back(std::move(step));
  try {
    while (run_->next()) {
    }
  } catch (...) {
    take_last();
    go_back();
    throw;
  }
}

void PlanSession::add(PlanStep step) {
  end_motion();
  carry_out(std::move(step));
  undone_.clear();
}

void PlanSession::grasp(const PlacedTool& forceps) {
  end_motion();
  const PlanTool& tool = plan_.tools.at(forceps.tool);
  if (!binds(tool.kind)) throw Error("'" + tool.tool.name + "' grasps nothing: only forceps and pins do");
  if (frame().poses[forceps.tool])
    throw Error("'" + tool.tool.name + "' holds already: release it before it grasps again");
  PlanStep step;
  step.action = PlanAction::kGrasp;
  step.motions.push_back({forceps.tool, ToolPath({{0, as_written(forceps.pose, plan_.body.unit)}})});
  add(std::move(step));
}

void PlanSession::close(const PlacedTool& grasper, double opening_m) {
  end_motion();
  const PlanTool& tool = plan_.tools.at(grasper.tool);
  if (!closes(tool.kind))
    throw Error("'" + tool.tool.name + "' closes nothing: only graspers and clips have jaws");
  refuse_used_up(grasper.tool);
  const OptionalPose& now = frame().poses[grasper.tool];
  const double from_m = now ? frame().grips[grasper.tool].opening_m : tool.opening_m;
  PlanStep step;
  step.action = PlanAction::kClose;
  step.opening_m =
      written_position({opening_m, 0, 0}, plan_.body.unit).x() / units_per_metre(plan_.body.unit);
  if (!(step.opening_m > 0 && step.opening_m <= tool.opening_m)) {
    throw Error("the jaws of '" + tool.tool.name + "' can be more than 0 and at most " +
                number_text(tool.opening_m * kMmPerM, 3) + " mm apart");
  }
  if (now && step.opening_m == from_m)
    throw Error("the jaws of '" + tool.tool.name + "' are that far apart already");
  // Half of what a plan's reader allows.
  const double each_m = tool.jaw_half_extent_m().z() / 2;
  const double steps = std::max(1.0, std::ceil(std::abs(step.opening_m - from_m) / 2 / each_m));
  step.duration_s = written_time(steps * plan_.time_step_s);
  step.motions.push_back(
      {grasper.tool, ToolPath({{0, now ? *now : as_written(grasper.pose, plan_.body.unit)}})});
  add(std::move(step));
}

bool PlanSession::used_up(std::size_t tool) const {
  return stays(plan_.tools.at(tool).kind) && std::ranges::any_of(plan_.steps, [&](const PlanStep& step) {
           return std::ranges::count(step.released, tool) > 0;
         });
}

void PlanSession::refuse_used_up(std::size_t tool) const {
  if (used_up(tool)) {
    throw Error("'" + plan_.tools[tool].tool.name +
                "' was left at the organ: a clip is used once; take another, or undo that");
  }
}

void PlanSession::release(std::size_t tool) {
  end_motion();
  refuse_used_up(tool);
  if (!frame().poses.at(tool)) throw Error("'" + plan_.tools[tool].tool.name + "' is not at the organ");
  PlanStep step;
  step.action = PlanAction::kRelease;
  step.released.push_back(tool);
  add(std::move(step));
}

void PlanSession::hold(double duration_s) {
  constexpr double kLongestS = 600;
  if (!(duration_s >= plan_.time_step_s && duration_s <= kLongestS))
    throw Error("a plan holds for at least one of its time steps and at most 600 s");
  PlanStep step;
  step.duration_s = written_time(duration_s);
  add(std::move(step));
}

void PlanSession::cut(std::size_t scalpel, std::span<const Pose> path) {
  if (plan_.tools.at(scalpel).kind != ToolKind::kScalpel)
    throw Error("'" + plan_.tools[scalpel].tool.name + "' does not cut: only a scalpel does");
  if (path.size() < 2) throw Error("a cut goes from one place to another: draw it longer");
  std::vector<KeyFrame> frames;
  for (const Pose& pose : path) {
    const double at_s = written_time(plan_.time_step_s * static_cast<double>(frames.size()));
    frames.push_back({at_s, as_written(pose, plan_.body.unit)});
  }
  PlanStep step;
  step.action = PlanAction::kCut;
  step.duration_s = frames.back().at_s;
  step.motions.push_back({scalpel, ToolPath(std::move(frames))});
  add(std::move(step));
}

PlanStep PlanSession::drawn_cut(std::size_t scalpel, const CutCurve& curve) const {
  CutCurve written = curve;
  const LengthUnit unit = plan_.body.unit;
  for (Vector3& handle_m : written.handles_m)
    handle_m = written_position(handle_m, unit) / units_per_metre(unit);
  for (double& depth_m : written.depth_m)
    depth_m = written_position({depth_m, 0, 0}, unit).x() / units_per_metre(unit);
  PlanStep step;
  step.action = PlanAction::kCut;
  step.motions.push_back(cut_along(plan_, scalpel, written));
  step.duration_s = step.motions.front().path.duration_s();
  step.curve = std::move(written);
  return step;
}

void PlanSession::cut(std::size_t scalpel, const CutCurve& curve) {
  end_motion();
  add(drawn_cut(scalpel, curve));
}

void PlanSession::change_cut(std::size_t number, const CutCurve& curve) {
  end_motion();
  if (number >= plan_.steps.size() || !plan_.steps[number].curve)
    throw Error("step " + std::to_string(number) +
                " is no cut along a curve, so that it has no handles to move");
  const PlanStep before = plan_.steps[number];
  PlanStep step = drawn_cut(before.motions.front().tool, curve);
  step.name = before.name;
  replace(number, std::move(step));
  changed_.push_back({before, number, plan_.steps.size()});
  undone_.clear();
}

/// From before the step on everything is carried out again; as it was where that cannot be.
void PlanSession::replace(std::size_t number, PlanStep step) {
  std::vector<PlanStep> later(plan_.steps.begin() + static_cast<std::ptrdiff_t>(number), plan_.steps.end());
  const auto go_on_from = [&](std::vector<PlanStep> steps) {
    if (plan_.steps.size() > number) {
      while (plan_.steps.size() > number + 1) {
        take_last();
        before_.pop_back();
      }
      take_last();
      go_back();
    }
    for (PlanStep& one : steps) carry_out(std::move(one));
  };
  std::vector<PlanStep> changed = later;
  changed.front() = std::move(step);
  try {
    go_on_from(std::move(changed));
  } catch (const Error&) {
    go_on_from(std::move(later));
    throw;
  }
  given_ = std::min(given_, number);
}

void PlanSession::begin_motion(std::vector<PlacedTool> tools) {
  assert(!tools.empty());
  end_motion();
  // Documents have them in the order of their names, which is that of the plan.
  std::ranges::sort(tools, {}, &PlacedTool::tool);
  PlanStep step;
  step.action = PlanAction::kPress;
  for (const PlacedTool& placed : tools) {
    const PlanTool& tool = plan_.tools.at(placed.tool);
    const OptionalPose& now = frame().poses[placed.tool];
    refuse_used_up(placed.tool);
    if (tool.kind == ToolKind::kScalpel) throw Error("'" + tool.tool.name + "' is moved by cutting");
    if (binds(tool.kind) || closes(tool.kind)) {
      if (!now) throw Error("'" + tool.tool.name + "' holds nothing that it could move");
      step.action = PlanAction::kRetract;
    }
    step.motions.push_back(
        {placed.tool, ToolPath({{0, now ? *now : as_written(placed.pose, plan_.body.unit)}})});
  }
  remember();
  step.where = "steps[" + std::to_string(plan_.steps.size()) + "]";
  plan_.steps.push_back(std::move(step));
  run_->keep_open();
  moving_ = true;
}

void PlanSession::grow(std::span<const Pose> poses) {
  PlanStep& step = plan_.steps.back();
  const double at_s = written_time(step.duration_s + plan_.time_step_s);
  for (std::size_t i = 0; i < step.motions.size(); ++i) {
    std::vector<KeyFrame> frames = step.motions[i].path.frames();
    frames.push_back({at_s, as_written(poses[i], plan_.body.unit)});
    step.motions[i].path = ToolPath(std::move(frames));
  }
  step.duration_s = at_s;
}

void PlanSession::advance(std::span<const Pose> poses) {
  if (!moving_ || poses.size() != plan_.steps.back().motions.size())
    throw UsageError("a motion goes on with a pose for each of its tools");
  const PlanStep before = plan_.steps.back();
  grow(poses);
  try {
    run_->next();
  } catch (const Error&) {
    take_last();
    go_back();
    // All but what could not be.
    if (before.duration_s > 0) {
      remember();
      plan_.steps.push_back(before);
      run_->keep_open();
      moving_ = true;
      while (run_->next()) {
      }
      end_motion();
    }
    throw;
  }
}

bool PlanSession::touched(std::size_t tool) const { return figures().back().most_nodes[tool] > 0; }

bool PlanSession::there_before_last_step(std::size_t tool) const {
  return before_.back()->frame().poses[tool].has_value();
}

std::vector<std::string> PlanSession::end_motion() {
  if (!moving_) return {};
  if (plan_.steps.back().duration_s == 0) {  // nothing has moved
    take_last();
    go_back();
    return {};
  }
  std::vector<std::size_t> missed;
  for (const PlanMotion& motion : plan_.steps.back().motions) {
    if (touches(plan_.tools[motion.tool].kind) && !touched(motion.tool)) missed.push_back(motion.tool);
  }
  undone_.clear();
  if (missed.empty()) {
    moving_ = false;
    ++revision_;
    run_->end_step();
    return {};
  }
  // A plan has no such motion; what does not touch changes nothing for the others.
  std::vector<std::string> names;
  std::vector<std::size_t> to_take_away;
  for (const std::size_t tool : missed) {
    names.push_back(plan_.tools[tool].tool.name);
    if (there_before_last_step(tool)) to_take_away.push_back(tool);
  }
  PlanStep step = take_last();
  go_back();
  std::erase_if(step.motions,
                [&](const PlanMotion& motion) { return std::ranges::count(missed, motion.tool) > 0; });
  for (const std::size_t tool : to_take_away) release(tool);
  if (!step.motions.empty()) carry_out(std::move(step));
  return names;
}

std::optional<std::size_t> PlanSession::undo() {
  end_motion();
  if (plan_.steps.empty()) return {};
  if (!changed_.empty() && changed_.back().steps == plan_.steps.size()) {
    const Changed change = std::move(changed_.back());
    changed_.pop_back();
    PlanStep now = plan_.steps[change.number];
    replace(change.number, change.step);
    undone_.push_back({std::move(now), change.number});
    return change.number;
  }
  undone_.push_back({take_last(), {}});
  go_back();
  given_ = std::min(given_, plan_.steps.size());
  return plan_.steps.size();
}

std::optional<std::size_t> PlanSession::redo() {
  end_motion();
  if (undone_.empty()) return {};
  Undone undone = std::move(undone_.back());
  undone_.pop_back();
  if (undone.instead_of) {
    const PlanStep before = plan_.steps[*undone.instead_of];
    replace(*undone.instead_of, std::move(undone.step));
    changed_.push_back({before, *undone.instead_of, plan_.steps.size()});
    return undone.instead_of;
  }
  carry_out(std::move(undone.step));
  return plan_.steps.size() - 1;
}

}  // namespace kiroku::sim

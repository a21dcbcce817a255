// A plan that is made by hand, deed by deed: each is carried out at once and becomes a step of the plan. What
// one sees is what PlanRun computes of that plan, to the bit, and a step that was undone leaves no trace.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sim/plan/plan_run.h"

namespace kiroku::sim {

/// A tool and where it is.
struct PlacedTool {
  std::size_t tool = 0;  // of the plan's
  Pose pose;
};

/// Tools are named by their number in the plan's. Poses are taken as_written(). A function that throws
/// kiroku::Error leaves the session as it was before the deed; while tools move, a deed that is none of
/// theirs ends that step first. Not thread-safe.
class PlanSession {
 public:
  /// Carries out the steps that the plan has; `progress` hears the time of each frame. What PlanRun throws.
  explicit PlanSession(Plan plan, const std::function<void(double time_s)>& progress = {});
  ~PlanSession();
  PlanSession(const PlanSession&) = delete;
  PlanSession& operator=(const PlanSession&) = delete;

  /// Its steps are what was done; the last still grows while tools move.
  [[nodiscard]] const Plan& plan() const { return plan_; }
  /// As it all is now.
  [[nodiscard]] const PlanFrame& frame() const { return run_->frame(); }
  [[nodiscard]] const TetMesh& mesh() const { return run_->mesh(); }
  [[nodiscard]] const std::vector<StepFigures>& figures() const { return run_->figures(); }
  /// How many of the first steps stand in the plan that the session began with.
  [[nodiscard]] std::size_t given_steps() const { return given_; }

  void grasp(const PlacedTool& forceps);
  /// A grasper or a clip, which comes there open where it is not at the organ yet and stays where it is if it
  /// is: closes its jaws, or opens them, until their faces are so far apart, as fast as a jaw may.
  void close(const PlacedTool& grasper, double opening_m);
  /// A clip stays at the organ, holds what is between its jaws, and is used up.
  void release(std::size_t tool);
  void hold(double duration_s);
  /// Along these poses, at least two, one time step from each to the next.
  void cut(std::size_t scalpel, std::span<const Pose> path);
  /// As cut_along() has it.
  void cut(std::size_t scalpel, const CutCurve& curve);
  /// Another curve, or another depth, for a cut that was drawn: from before it on everything is carried out
  /// again. undo() gives the curve back that was there.
  void change_cut(std::size_t step, const CutCurve& curve);

  /// Begins a step in which these tools move together. One that is not at the organ yet comes to where its
  /// pose says; the others begin where they are.
  void begin_motion(std::vector<PlacedTool> tools);
  /// One time step; the poses in the order of begin_motion(). What cannot be ends the motion before it.
  void advance(std::span<const Pose> poses);
  /// Tools that never touched the tissue are left out of the step and taken away; a motion without any is no
  /// step. Names those.
  std::vector<std::string> end_motion();
  [[nodiscard]] bool moving() const { return moving_; }
  /// A clip that was left at the organ: no deed takes it again.
  [[nodiscard]] bool used_up(std::size_t tool) const;

  /// The last deed, a step or a change of one, which redo() does again. The first step that was taken away or
  /// carried out again; nothing where there is none.
  std::optional<std::size_t> undo();
  std::optional<std::size_t> redo();
  /// Another number whenever a step has come, gone or ended.
  [[nodiscard]] std::uint64_t revision() const { return revision_; }
  [[nodiscard]] bool can_undo() const { return !plan_.steps.empty(); }
  [[nodiscard]] bool can_redo() const { return !undone_.empty(); }

 private:
  /// A step that was undone, or another form of the step of that number.
  struct Undone {
    PlanStep step;
    std::optional<std::size_t> instead_of;
  };
  /// What a step was before it was changed, while the plan had so many steps.
  struct Changed {
    PlanStep step;
    std::size_t number = 0, steps = 0;
  };

  void add(PlanStep step);
  void replace(std::size_t number, PlanStep step);
  [[nodiscard]] PlanStep drawn_cut(std::size_t scalpel, const CutCurve& curve) const;
  void carry_out(PlanStep step);
  void remember();
  void go_back();
  PlanStep take_last();
  void grow(std::span<const Pose> poses);
  void refuse_used_up(std::size_t tool) const;
  [[nodiscard]] bool touched(std::size_t tool) const;
  [[nodiscard]] bool there_before_last_step(std::size_t tool) const;

  Plan plan_;
  std::size_t given_ = 0;
  std::unique_ptr<PlanRun> run_;
  /// As it was before each step; nothing where that is to be computed anew.
  std::vector<std::unique_ptr<const PlanRun>> before_;
  std::vector<Undone> undone_;    // the last is redone first
  std::vector<Changed> changed_;  // the last is undone first, once the steps after it are
  bool moving_ = false;
  std::uint64_t revision_ = 0;
};

}  // namespace kiroku::sim

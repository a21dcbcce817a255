// A plan carried out, frame by frame. Same plan, same bits, whatever the number of threads.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sim/cutting/cut_shape.h"
#include "sim/plan/plan_body.h"

namespace kiroku::sim {

/// How a grasper or a clip has the tissue.
struct PlanGrip {
  double opening_m = 0;  // between the faces of its jaws
  Grip grip;
  double slipped_m = 0;  // how far the tissue has moved along its jaws since these came
  bool slips =
      false;  // friction cannot hold it, or it has slipped by a tenth of the jaws' length in this step
  bool left =
      false;  // a clip whose applier has left: it holds (grip_of_left()) and goes where the tissue does
};

/// How the organ lies at a moment. All numbers are finite.
struct PlanFrame {
  double time_s = 0;     // since the plan began
  std::size_t step = 0;  // which of the plan's steps led here; the first frame comes before the first step
  Eigen::VectorXd displacement_m;          // (3 |V|), from mesh()
  std::vector<SymmetricTensor> stress_pa;  // (|T|) of mesh(); zero in what has fallen off
  std::vector<OptionalPose> poses;         // of the plan's tools
  std::vector<ToolForce> tools;            // what they feel; zero for scalpels
  std::vector<PlanGrip> grips;             // of the plan's tools; zero for those without jaws at the organ
  Eigen::VectorXd tool_force_n;            // (3 |V|), what all tools do to the nodes
};

/// What a step came to.
struct StepFigures {
  double begins_s = 0;
  std::size_t frames = 0;
  double largest_displacement_m = 0, largest_von_mises_pa = 0;
  std::vector<double> largest_force_n;    // of each of the plan's tools
  std::vector<std::size_t> most_nodes;    // that each held or pressed
  std::vector<double> largest_squeeze_n;  // with which each grasper's jaws pressed
  std::vector<double> slipped_m;          // along each grasper's jaws, in this step
  std::size_t tetrahedra_removed = 0;
  double volume_lost_m3 = 0;
  double deepest_penetration_m = 0;
  /// Parts that fell off; tissue that slips; clips that come off; balances out of tolerance.
  std::vector<std::string> remarks;
};

/// Not thread-safe. The plan must outlive it; steps may be added at its end meanwhile, and its last step may
/// grow while it is kept open.
class PlanRun {
 public:
  /// kiroku::Error for a body that cannot be solved for, as ElasticBody throws it.
  explicit PlanRun(const Plan& plan);
  /// Goes on from the same moment by itself, to the same bits; what neither changes they share.
  PlanRun(const PlanRun& other);
  PlanRun& operator=(const PlanRun&) = delete;
  ~PlanRun();

  /// Computes the next frame; false after the last. kiroku::Error, beginning with the step's JSON path, for
  /// what cannot be done: nothing to grasp, a tool that never touches, a scalpel that meets nothing, tools
  /// that leave the tissue no place. The run is at its end then.
  bool next();

  /// The plan's last step is not over when its end is reached: next() is false then, until the step has grown
  /// or end_step() ends it.
  void keep_open() { kept_open_ = true; }
  /// kiroku::Error as next() throws it at the end of a step.
  void end_step();

  [[nodiscard]] const PlanFrame& frame() const { return frame_; }
  /// Its nodes and tetrahedra as of the last frame: without those that cuts took out.
  [[nodiscard]] const TetMesh& mesh() const { return mesh_; }
  /// Of the steps begun so far.
  [[nodiscard]] const std::vector<StepFigures>& figures() const { return figures_; }

 private:
  template <typename Do>
  void at_step(Do what);
  void begin_step();
  void advance(double local_s);
  void finish_step();
  void expect_room_for_jaws(std::size_t tool) const;
  void leave(std::size_t tool);
  [[nodiscard]] bool let_go_of_clips(const ManipulationResult& result);
  void grip_left(std::size_t tool, const ManipulationResult& result);
  void grip(std::size_t tool, const ManipulationResult& result);
  void tell_slips();
  void cut(const PlanMotion& motion, double from_s, double to_s);
  void show_blade(const PlanMotion& motion);
  void balance();
  void record();
  [[nodiscard]] BladePose blade(const PlanMotion& motion, double local_s) const;
  [[nodiscard]] double distance_m(std::size_t tool) const;
  [[nodiscard]] bool at_end() const;

  const Plan& plan_;
  std::vector<std::size_t>
      place_of_;  // of the plan's tools among those of the manipulation; of one with jaws the first
  std::size_t places_ = 0;
  std::optional<CutShape> shape_;  // once something was cut
  std::unique_ptr<PlanBody> body_;
  TetMesh mesh_;
  std::vector<std::uint8_t> bears_;  // (|T| of mesh_); those that do are the body's, in their order

  bool begun_ = false, in_step_ = false, kept_open_ = false, unbalanced_told_ = false;
  std::size_t step_ = 0;
  double step_begins_s_ = 0, local_s_ = 0;
  std::vector<double> nearest_m_;  // of each tool that a step moves and that has not touched yet
  double closes_from_m_ = 0;       // the opening at the beginning of a step that closes
  std::vector<std::map<std::uint32_t, Vector3>>
      on_jaws_m_;                                    // nodes between each grasper's jaws, in its frame
  std::vector<std::uint8_t> slip_told_, lost_told_;  // of each grasper, in this step
  std::vector<double> slipped_before_m_;             // of each, before this step
  std::optional<BladePose> blade_rest_;
  PlanFrame frame_;
  std::vector<StepFigures> figures_;
};

}  // namespace kiroku::sim

// A trainee as a model, for proving the study's pipeline. Its results are simulated and say nothing about
// people.
#pragma once

#include <random>

#include "trainer/exclusion/exclusion_run.h"

namespace kiroku::trainer {

/// How a hand lifts.
struct LiftPlan {
  /// Where, from where the rule puts a hand: along the border, and further in.
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();
  std::vector<double> offset_m;  // how much higher each finger is than the hand; as many as fingers
  double beyond_m = 0.004;       // how much further than needed
  double speed_m_s = 0.006;
};

/// How unevenly somebody lifts who has not practised: the standard deviation of the fingers' heights.
inline constexpr double kUnevenMetres = 0.004;
/// Of so many fingers (1 to 5), uneven by chance. The same seed gives the same.
LiftPlan unpractised_plan(std::size_t fingers, std::uint32_t seed);

/// A controller that knows what a trainee is shown: how much of the line it sees, the forces of its fingers,
/// and the stress where it is shown; nothing else. It lifts where the rule puts its hand. Where the line does
/// not come into sight, or the fingers or the stress say that it is too much, it comes back and tries another
/// place along the border and further in, the best of those that it tried again at the end. A device whose
/// time is its steps. Not thread-safe.
class SimulatedTrainee : public sim::HapticDevice {
 public:
  /// Fingers below the object's border, to lift it as planned. kiroku::UsageError for other than 1 to 5.
  SimulatedTrainee(const ExclusionBody& body, LiftPlan plan, double period_s);

  [[nodiscard]] std::size_t tools() const override { return plan_.offset_m.size(); }
  bool read(std::span<sim::Pose> poses) override;
  void write(std::span<const sim::Vector3> forces_n) override;
  /// To be called with each picture: an observer. `shown_stress` as the picture shows it.
  void see(const ExclusionView& view, bool shown_stress);

  /// How many places it has begun to lift at, from 1 on.
  [[nodiscard]] int places_tried() const { return tried_; }

 private:
  /// A hand's place, from where the rule puts it: along the border, and further in.
  using Place = Eigen::Vector2d;
  enum class Doing : std::uint8_t { kLifts, kComesBack, kMovesOn };

  void go_on_elsewhere();
  void even_out();

  LiftPlan plan_;
  double period_s_, needed_share_, damage_pa_;
  sim::Vector3 lifts_, aside_, away_;
  Eigen::Quaterniond held_;  // each finger
  sim::Vector3 begins_m_;    // the middle of the hand
  std::span<const double> side_by_side_m_;
  std::vector<sim::Vector3> felt_n_;
  Doing doing_ = Doing::kLifts;
  Place at_m_, goes_to_m_;
  std::size_t next_place_ = 0;
  int tried_ = 1;
  double lifted_m_ = 0, goal_m_;
  double best_here_ = 0, best_share_ = 0;
  Place best_m_ = Place::Zero();
  bool sees_line_ = false;
};

}  // namespace kiroku::trainer

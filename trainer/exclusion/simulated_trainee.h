// A trainee as a model, for proving the study's pipeline. Its results are simulated and say nothing about
// people.
#pragma once

#include <random>

#include "trainer/exclusion/exclusion_run.h"

namespace kiroku::trainer {

/// What changes with practice. The model: fingers that lift unevenly press one place hard. Who sees stress
/// evens them out as it happens and remembers it; who does not learns by the way alone.
struct TraineeSkill {
  double unevenness_m = 0.004;  // how far fingers are apart when they lift, the standard deviation
  double speed_m_s = 0.006;
  double beyond_m = 0.004;  // how much further than needed the organ is lifted
};

/// A controller that knows what a trainee is shown: how much of the line it sees, the forces of its fingers,
/// and the stress where it is shown; nothing else. A device whose time is its steps. Not thread-safe.
class SimulatedTrainee : public sim::HapticDevice {
 public:
  /// Fingers below the object's border, to lift it. kiroku::UsageError for other than 1 to 5.
  SimulatedTrainee(const ExclusionBody& body, std::size_t fingers, const TraineeSkill& skill, double period_s,
                   std::uint32_t seed);

  [[nodiscard]] std::size_t tools() const override { return poses_.size(); }
  bool read(std::span<sim::Pose> poses) override;
  void write(std::span<const sim::Vector3> forces_n) override;
  /// To be called with each picture: an observer. `shown_stress` as the picture shows it.
  void see(const ExclusionView& view, bool shown_stress);

  /// The skill after the attempt: what `shown_stress` changed.
  [[nodiscard]] TraineeSkill learnt(bool shown_stress) const;

 private:
  TraineeSkill skill_;
  double period_s_, needed_share_, damage_pa_;
  sim::Vector3 lifts_;
  std::vector<sim::Pose> poses_;
  std::vector<double> offset_m_;  // of each finger's height
  std::vector<sim::Vector3> felt_n_;
  double lifted_m_ = 0, goal_m_ = 0;
  bool sees_line_ = false;
};

}  // namespace kiroku::trainer

// What the fingers of a trainee feel, and what their hand does, from the force loop's side.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "sim/haptics/haptic_contact.h"
#include "trainer/exclusion/exclusion_body.h"

namespace kiroku::trainer {

inline constexpr std::size_t kMostExclusionFingers = 5;

enum class Feedback {
  kFull,        // the force on each finger, in three directions
  kTangential,  // its part along the finger's z axis, the way the finger bends: f_i cos(theta)
};
/// "full", "tangential"; kiroku::UsageError for others.
Feedback feedback_of(const std::string& name);

/// What a device plays of a force on a finger that is held like `pose`.
sim::Vector3 played_n(Feedback feedback, const sim::Pose& pose, const sim::Vector3& force_n);

/// Whether a finger presses harder than that.
bool any_above(double newtons, std::span<const sim::Vector3> forces_n);

/// Fingertips as tools, 1 to kMostExclusionFingers; kiroku::UsageError for others. `friction` as of
/// ExclusionTask: 0 glides.
std::vector<sim::ContactTool> fingertips(std::size_t count, double friction);

/// Where fingers lie side by side along a border, from its middle: 1 to kMostExclusionFingers numbers,
/// kiroku::UsageError for others.
std::span<const double> side_by_side_m(std::size_t fingers);

/// The forces of contact as a device plays them; follows how far fingers move and how hard they press.
/// forces() is for the force loop, the others for one other thread.
class HandForces : public sim::ForceSource {
 public:
  HandForces(const ExclusionBody& body, std::size_t fingers, Feedback feedback);
  void forces(std::span<const sim::Pose> poses, double period_s, std::span<sim::Vector3> forces_n) override;
  /// Of the whole forces, whatever of them the fingers are played.
  sim::WristForce wrist_force(const sim::Vector3& wrist_m) override;

  /// How the body lies now, and what is near the fingers from now on: HapticContact::refresh().
  [[nodiscard]] sim::HapticContact::Deformation refresh() { return contact_.refresh(); }

  struct State {
    bool any = false;  // poses came
    std::vector<sim::Pose> poses;
    std::vector<sim::Vector3> forces_n;           // on the fingers, whole, whatever is played
    sim::Vector3 wrist_n = sim::Vector3::Zero();  // their sum
    std::optional<sim::Vector3> wrist_torque_nm;  // about the wrist, of devices that say where it is
    double path_m = 0, peak_force_n = 0, peak_wrist_n = 0;
  };
  [[nodiscard]] State state() const;

 private:
  void publish();

  sim::HapticContact contact_;
  Feedback feedback_;
  State now_;                 // the force loop's
  mutable std::mutex mutex_;  // the force loop only tries it
  State seen_;
};

}  // namespace kiroku::trainer

// What the fingers of a trainee feel, and what their hand does, from the force loop's side.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "sim/haptics/haptic_contact.h"
#include "trainer/exclusion/exclusion_body.h"
#include "trainer/hand/hand_shape.h"

namespace kiroku::trainer {

enum class Feedback {
  kFull,        // the force on each finger, in three directions
  kTangential,  // its part along the finger's z axis, the way the finger bends: f_i cos(theta)
};
/// "full", "tangential"; kiroku::UsageError for others.
Feedback feedback_of(const std::string& name);

enum class Touch {
  kFingertips,  // alone, as in the exclusion study
  kHand,        // phalanges and palm, too (HandShape)
  kTrocar,      // instruments that pivot in trocars_of() the task; a device's tools are their handles
};
/// "fingertips", "hand", "trocar"; kiroku::UsageError for others.
Touch touch_of(const std::string& name);

/// Of instruments in trocars.
struct InstrumentOptions {
  InstrumentTip tip = InstrumentTip::kRetractor;
  double seal_friction_n = 0;  // what the seal of each trocar rubs with
};

/// What a device plays of a force on a finger that is held like `pose`.
sim::Vector3 played_n(Feedback feedback, const sim::Pose& pose, const sim::Vector3& force_n);

/// Whether a finger presses harder than that.
bool any_above(double newtons, std::span<const sim::Vector3> forces_n);

/// Fingertips as tools, 1 to kMostExclusionFingers; kiroku::UsageError for others. `friction` as of
/// ExclusionTask: 0 glides.
std::vector<sim::ContactTool> fingertips(std::size_t count, double friction);

/// What touches: fingertips or the tips of instruments, then what is behind them (HandForces::State::poses
/// and parts, in this order). As fingertips().
std::vector<sim::ContactTool> touching_tools(std::size_t fingers, Touch touch, double friction,
                                             const InstrumentOptions& instruments = {});

/// The forces of contact as a device plays them; follows how far fingers move and how hard they press. A
/// finger is played what its fingertip feels; what phalanges and palm feel is borne by the wrist alone. The
/// handle of an instrument is played what its lever leaves of the tissue's force, the wrist bears its torque
/// about the shaft, too. forces() is for the force loop, the others for one other thread.
class HandForces : public sim::ForceSource {
 public:
  HandForces(const ExclusionBody& body, std::size_t fingers, Feedback feedback,
             Touch touch = Touch::kFingertips, const InstrumentOptions& instruments = {});
  /// Of devices without a wrist it is that of HandShape::wrist_behind(), and has no torque.
  void wrist_at(const std::optional<sim::Pose>& wrist) override;
  void forces(std::span<const sim::Pose> poses, double period_s, std::span<sim::Vector3> forces_n) override;
  /// Of the whole forces, whatever of them the fingers are played.
  sim::WristForce wrist_force(const sim::Vector3& wrist_m) override;

  /// How the body lies now, and what is near the fingers from now on: HapticContact::refresh().
  [[nodiscard]] sim::HapticContact::Deformation refresh() { return contact_.refresh(); }

  struct Instrument {
    InstrumentPlace place;
    InstrumentForces forces;
  };
  struct State {
    bool any = false;                    // poses came
    std::vector<sim::Pose> poses;        // of fingertips, or of instruments' tips
    std::vector<sim::Vector3> forces_n;  // on the fingers or instruments, whole, whatever is played
    std::vector<sim::Pose> parts;        // of HandShape, where the whole hand touches; shafts
    std::vector<sim::Vector3> parts_n;
    std::vector<Instrument> instruments;          // as many as poses, or none
    sim::Vector3 wrist_n = sim::Vector3::Zero();  // the sum of all that hands feel
    std::optional<sim::Vector3> wrist_torque_nm;  // about the wrist, of devices that say where it is
    double path_m = 0, peak_force_n = 0, peak_wrist_n = 0;
    double peak_wall_n = 0;  // on the wall at a trocar
  };
  [[nodiscard]] State state() const;

 private:
  void place(std::span<const sim::Pose> poses);
  void bear(std::size_t finger);
  void publish();

  HandShape shape_;
  InstrumentShape instrument_shape_;
  Touch touch_;
  sim::HapticContact contact_;
  Feedback feedback_;
  // The force loop's.
  State now_;
  std::optional<sim::Pose> wrist_;
  std::vector<Trocar> trocars_;  // of instruments
  std::vector<SealFriction> seals_;
  std::vector<sim::Pose> all_poses_;  // as touching_tools()
  std::vector<sim::Vector3> all_n_;

  mutable std::mutex mutex_;  // the force loop only tries it
  State seen_;
};

}  // namespace kiroku::trainer

// Instruments that pivot in a trocar: a handle outside the body wall, a straight shaft through one fixed
// point of the wall, a tip inside.
//
//   handle ●━━━━━━━━━━━━━━━━━┃━━━━━━━━━━━━■■■ tip        outside a = handle to trocar
//            outside a    trocar   depth b               depth   b = trocar to the tip's end, a + b = length
//
// The wall leaves four of six freedoms: depth, two tilts, roll. Across the shaft the tip moves against the
// hand, b / a as far (the fulcrum effect). The handle's place gives depth and tilts, its orientation the roll
// alone. Frames: of a trocar, z goes into the body and tilts are counted from it; of a handle, z goes along
// the shaft to the tip. Lengths are ours: those of a common instrument of 5 mm.
//
// The instrument is rigid and weighs nothing, so that what acts on it is in balance at every moment:
// tissue + hand + wall = 0, and so are their torques. The wall bears no torque about the trocar's point.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "sim/contact/contact_solver.h"
#include "sim/haptics/haptic_device.h"

namespace kiroku::trainer {

enum class InstrumentTip {
  kRetractor,  // a flat, blunt blade: 20 mm wide, 5 mm thick, 40 mm long
  kJaws,       // closed jaws: a rod of 5 mm, 20 mm long
};
/// "retractor", "jaws"; kiroku::UsageError for others.
InstrumentTip instrument_tip_of(const std::string& name);

inline constexpr double kInstrumentMetres = 0.33;  // from the handle to the tip's end
inline constexpr double kShaftRadiusMetres = 0.0025;
/// A handle cannot come nearer to the trocar than its housing lets it, nor lie flatter on the wall.
inline constexpr double kLeastOutsideMetres = 0.04, kMostTiltRadians = 1.3;
inline constexpr double kMostSealFrictionNewtons = 20;

/// Where the wall is pierced: its position is the pivot, its z axis goes into the body.
struct Trocar {
  sim::Pose pose;
};

/// How an instrument lies in its trocar.
struct InstrumentPlace {
  /// Of the tip's end, behind the wall; negative for an instrument that is drawn out of the trocar.
  double depth_m = 0;
  double outside_m = 0;  // from the handle to the trocar, at least kLeastOutsideMetres
  /// Of the shaft towards the trocar's x and y axes: what its tip is moved by, seen along the trocar's z
  /// axis.
  double tilt_x_rad = 0, tilt_y_rad = 0;
  double roll_rad = 0;  // about the shaft, -pi to pi
  sim::Pose handle;     // that is so; z along the shaft

  [[nodiscard]] sim::Vector3 along() const { return handle.orientation * sim::Vector3::UnitZ(); }
};

/// What a device's handle does to an instrument. Where no instrument can follow (kLeastOutsideMetres,
/// kMostTiltRadians), that of the handle drawn back along the trocar's axis to the first place where one can.
/// Depth and tilts are continuous everywhere: while a handle moves, the tip's end goes less than 30 times as
/// far. The roll is not: of a handle that is turned across the trocar's axis by half a turn none is known
/// (0), and beside that it may jump. Pure; thread-safe.
InstrumentPlace instrument_at(const Trocar& trocar, const sim::Pose& handle);

/// What acts on the parts of an instrument, N and N m in the mesh's frame.
struct InstrumentForces {
  sim::Vector3 tissue_n = sim::Vector3::Zero();  // on the instrument, from the tissue: tip and shaft
  sim::Vector3 handle_n = sim::Vector3::Zero();  // on the hand, at the handle: what a device plays
  /// On the hand: the torque about the shaft. Any other is borne by the force at the handle and the wall.
  sim::Vector3 handle_nm = sim::Vector3::Zero();
  sim::Vector3 wall_n = sim::Vector3::Zero();  // on the wall, at the trocar: tissue_n = handle_n + wall_n
};

/// What hand and wall bear of tissue that acts on the instrument with `tissue_n`, and with `torque_nm` about
/// the trocar's point, while the seal's friction acts with `seal_n` along the shaft (positive towards the
/// tip). Along the shaft the hand feels tissue and friction; across it, the tissue's force times depth by
/// outside, the other way round. Pure; thread-safe.
InstrumentForces levered(const InstrumentPlace& place, const sim::Vector3& tissue_n,
                         const sim::Vector3& torque_nm, double seal_n = 0);

/// The seal of a trocar that rubs on the shaft as it is pushed and drawn: dry friction, which gives way
/// elastically by half a millimetre before it slides, as a rubber lip does (the elastic place of Hayward and
/// Armstrong's "A new computational model of friction applied to haptic rendering", 2000). So it needs no
/// velocity, and is continuous. Not thread-safe.
class SealFriction {
 public:
  static constexpr double kGivesMetres = 5e-4;
  /// `newtons` is what a shaft slides at; 0 rubs not. kiroku::UsageError for less, and for more than
  /// kMostSealFrictionNewtons.
  explicit SealFriction(double newtons);
  /// At that depth, after the one before: the force on the instrument along the shaft, positive towards the
  /// tip. None for an instrument that is drawn out.
  double at(double depth_m);

 private:
  double newtons_;
  double stuck_at_m_ = 0;
  bool inside_ = false;
};

/// The parts of instruments that touch. Immutable; thread-safe.
class InstrumentShape {
 public:
  explicit InstrumentShape(InstrumentTip tip) : tip_(tip) {}
  /// For errors named "tip of instrument 1"; `friction` of Coulomb, 0 glides.
  [[nodiscard]] std::vector<sim::ContactTool> tips(std::size_t instruments, double friction) const;
  [[nodiscard]] std::vector<sim::ContactTool> shafts(std::size_t instruments, double friction) const;
  [[nodiscard]] sim::Pose tip_at(const InstrumentPlace& place) const;
  [[nodiscard]] sim::Pose shaft_at(const InstrumentPlace& place) const;
  /// The handle of an instrument, not rolled, whose tip's middle is there; the other way round as tip_at().
  /// The place must not be the trocar's.
  [[nodiscard]] sim::Pose handle_for(const Trocar& trocar, const sim::Vector3& tip_middle_m) const;

 private:
  [[nodiscard]] sim::Pose on_shaft(const InstrumentPlace& place, double from_handle_m) const;
  InstrumentTip tip_;
};

/// A device whose tools are tips, as one whose tools are the handles of instruments: for hands that know
/// where tips are to be, such as a simulated trainee's. Forces are passed on as they come, those of the
/// handles. Not thread-safe.
class HandlesOfTips : public sim::HapticDevice {
 public:
  /// `tips` must outlive it. As many trocars as it has tools, else kiroku::UsageError.
  HandlesOfTips(sim::HapticDevice& tips, std::vector<Trocar> trocars, const InstrumentShape& shape);
  [[nodiscard]] std::size_t tools() const override { return tips_.tools(); }
  bool read(std::span<sim::Pose> poses) override;
  void write(std::span<const sim::Vector3> forces_n) override { tips_.write(forces_n); }

 private:
  sim::HapticDevice& tips_;
  std::vector<Trocar> trocars_;
  InstrumentShape shape_;
};

}  // namespace kiroku::trainer

#include "trainer/hand/trocar.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::trainer {

using sim::Pose;
using sim::Vector3;

namespace {

const Vector3 kBladeHalfMetres(0.010, 0.0025, 0.020);
constexpr double kJawsHalfMetres = 0.010;

/// Of the tip, along the shaft, with the round end of jaws.
double half_length_m(InstrumentTip tip) {
  return tip == InstrumentTip::kRetractor ? kBladeHalfMetres.z() : kJawsHalfMetres;
}

/// The roll of an orientation about its z axis, once the shortest turn of z is taken off (swing and twist).
double twist_rad(const Eigen::Quaterniond& of) {
  // Turned by half a turn across z: any roll would do.
  if (std::hypot(of.w(), of.z()) < 1e-9) return 0;
  return std::remainder(2 * std::atan2(of.z(), of.w()), 2 * std::numbers::pi);
}

std::vector<sim::ContactTool> tools_of(const std::string& part, const sim::ToolShape& shape,
                                       std::size_t instruments, double friction) {
  std::vector<sim::ContactTool> tools;
  for (std::size_t i = 1; i <= instruments; ++i) {
    tools.push_back({part + " of instrument " + std::to_string(i), shape});
    if (friction == 0) continue;
    tools.back().sticks = true;
    tools.back().friction = friction;
  }
  return tools;
}

}  // namespace

InstrumentTip instrument_tip_of(const std::string& name) {
  if (name == "retractor") return InstrumentTip::kRetractor;
  if (name == "jaws") return InstrumentTip::kJaws;
  throw UsageError("'" + name + "' is no tip of an instrument: it must be retractor or jaws");
}

InstrumentPlace instrument_at(const Trocar& trocar, const Pose& handle) {
  Vector3 to_trocar = -trocar.pose.to_tool(handle.position_m);
  const double aside_m = std::hypot(to_trocar.x(), to_trocar.y());
  // Drawn back along the trocar's axis until an instrument can lie there: so the shaft's direction does not
  // jump where a hand passes the trocar or goes through the wall.
  const double off_sphere_m =
      std::sqrt(std::max(0.0, kLeastOutsideMetres * kLeastOutsideMetres - aside_m * aside_m));
  const double in_cone_m = aside_m / std::tan(kMostTiltRadians);
  to_trocar.z() = std::max({to_trocar.z(), off_sphere_m, in_cone_m});
  const double far_m = to_trocar.norm();
  const Vector3 along = to_trocar / far_m;
  InstrumentPlace place;
  place.outside_m = std::max(far_m, kLeastOutsideMetres);  // rounding may leave it a hair less
  place.depth_m = kInstrumentMetres - place.outside_m;
  place.tilt_x_rad = std::atan2(along.x(), along.z());
  place.tilt_y_rad = std::atan2(along.y(), along.z());
  place.roll_rad = twist_rad(trocar.pose.orientation.conjugate() * handle.orientation);
  place.handle.position_m = trocar.pose.from_tool(-place.outside_m * along);
  place.handle.orientation =
      (trocar.pose.orientation * Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), along) *
       Eigen::AngleAxisd(place.roll_rad, Vector3::UnitZ()))
          .normalized();
  return place;
}

InstrumentForces levered(const InstrumentPlace& place, const Vector3& tissue_n, const Vector3& torque_nm,
                         double seal_n) {
  const Vector3 along = place.along();
  InstrumentForces forces;
  forces.tissue_n = tissue_n;
  // About the trocar's point the hand alone balances the tissue: its force across the shaft, at -outside of
  // the way along it, and its torque about the shaft.
  forces.handle_n = (tissue_n.dot(along) + seal_n) * along + along.cross(torque_nm) / place.outside_m;
  forces.handle_nm = torque_nm.dot(along) * along;
  forces.wall_n = tissue_n - forces.handle_n;
  return forces;
}

SealFriction::SealFriction(double newtons) : newtons_(newtons) {
  if (!(newtons >= 0 && newtons <= kMostSealFrictionNewtons))
    throw UsageError("the friction of a trocar's seal is 0 to " + number_text(kMostSealFrictionNewtons, 3) +
                     " N");
}

double SealFriction::at(double depth_m) {
  if (!inside_ || depth_m <= 0) stuck_at_m_ = depth_m;
  inside_ = depth_m > 0;
  stuck_at_m_ = std::clamp(stuck_at_m_, depth_m - kGivesMetres, depth_m + kGivesMetres);
  return newtons_ * (stuck_at_m_ - depth_m) / kGivesMetres;
}

std::vector<sim::ContactTool> InstrumentShape::tips(std::size_t instruments, double friction) const {
  const sim::ToolShape shape =
      tip_ == InstrumentTip::kRetractor
          ? sim::ToolShape(sim::Box{kBladeHalfMetres})
          : sim::ToolShape(sim::Capsule{kShaftRadiusMetres, kJawsHalfMetres - kShaftRadiusMetres});
  return tools_of("tip", shape, instruments, friction);
}

std::vector<sim::ContactTool> InstrumentShape::shafts(std::size_t instruments, double friction) const {
  const double half_m = kInstrumentMetres / 2 - half_length_m(tip_);
  return tools_of("shaft", sim::Capsule{kShaftRadiusMetres, half_m - kShaftRadiusMetres}, instruments,
                  friction);
}

Pose InstrumentShape::on_shaft(const InstrumentPlace& place, double from_handle_m) const {
  return {place.handle.from_tool({0, 0, from_handle_m}), place.handle.orientation};
}

Pose InstrumentShape::tip_at(const InstrumentPlace& place) const {
  return on_shaft(place, kInstrumentMetres - half_length_m(tip_));
}

Pose InstrumentShape::shaft_at(const InstrumentPlace& place) const {
  return on_shaft(place, kInstrumentMetres / 2 - half_length_m(tip_));
}

Pose InstrumentShape::handle_for(const Trocar& trocar, const Vector3& tip_middle_m) const {
  const Vector3 along = trocar.pose.to_tool(tip_middle_m).normalized();
  return {
      tip_middle_m - (kInstrumentMetres - half_length_m(tip_)) * (trocar.pose.orientation * along),
      (trocar.pose.orientation * Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), along)).normalized()};
}

HandlesOfTips::HandlesOfTips(sim::HapticDevice& tips, std::vector<Trocar> trocars,
                             const InstrumentShape& shape)
    : tips_(tips), trocars_(std::move(trocars)), shape_(shape) {
  if (trocars_.size() != tips_.tools())
    throw UsageError("each instrument needs a trocar of its own: there are " +
                     std::to_string(trocars_.size()) + " trocars for " + std::to_string(tips_.tools()) +
                     " instruments");
}

bool HandlesOfTips::read(std::span<Pose> poses) {
  if (!tips_.read(poses)) return false;
  for (std::size_t i = 0; i < poses.size(); ++i)
    poses[i] = shape_.handle_for(trocars_[i], poses[i].position_m);
  return true;
}

}  // namespace kiroku::trainer

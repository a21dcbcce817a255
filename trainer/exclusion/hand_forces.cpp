#include "trainer/exclusion/hand_forces.h"

#include <algorithm>
#include <iterator>

#include "base/error.h"

namespace kiroku::trainer {

using sim::Vector3;

Feedback feedback_of(const std::string& name) {
  if (name == "full") return Feedback::kFull;
  if (name == "tangential") return Feedback::kTangential;
  throw UsageError("'" + name + "' is no way to play forces: it must be full or tangential");
}

Touch touch_of(const std::string& name) {
  if (name == "fingertips") return Touch::kFingertips;
  if (name == "hand") return Touch::kHand;
  if (name == "trocar") return Touch::kTrocar;
  throw UsageError("'" + name + "' is nothing to touch with: it must be fingertips, hand or trocar");
}

Vector3 played_n(Feedback feedback, const sim::Pose& pose, const Vector3& force_n) {
  if (feedback == Feedback::kFull) return force_n;
  const Vector3 along = pose.orientation * Vector3::UnitZ();
  return force_n.dot(along) * along;
}

std::vector<sim::ContactTool> fingertips(std::size_t count, double friction) {
  (void)side_by_side_m(count);  // refuses what no hand has
  std::vector<sim::ContactTool> tools;
  for (std::size_t i = 0; i < count; ++i) {
    tools.push_back({"finger " + std::to_string(i + 1), sim::Sphere{kFingertipMetres}});
    if (friction == 0) continue;
    tools.back().sticks = true;
    tools.back().friction = friction;
  }
  return tools;
}

bool any_above(double newtons, std::span<const sim::Vector3> forces_n) {
  return std::ranges::any_of(forces_n, [&](const sim::Vector3& force_n) { return force_n.norm() > newtons; });
}

std::vector<sim::ContactTool> touching_tools(std::size_t fingers, Touch touch, double friction,
                                             const InstrumentOptions& instruments) {
  std::vector<sim::ContactTool> tools, behind;
  if (touch == Touch::kTrocar) {
    (void)side_by_side_m(fingers);
    const InstrumentShape shape(instruments.tip);
    tools = shape.tips(fingers, friction);
    behind = shape.shafts(fingers, friction);
  } else {
    tools = fingertips(fingers, friction);
    if (touch == Touch::kHand) behind = HandShape(fingers).tools(friction);
  }
  std::ranges::move(behind, std::back_inserter(tools));
  return tools;
}

HandForces::HandForces(const ExclusionBody& body, std::size_t fingers, Feedback feedback, Touch touch,
                       const InstrumentOptions& instruments)
    : shape_(fingers),
      instrument_shape_(instruments.tip),
      touch_(touch),
      contact_(body.contact(), touching_tools(fingers, touch, body.task().friction, instruments)),
      feedback_(feedback) {
  now_.poses.resize(fingers);
  now_.forces_n.assign(fingers, Vector3::Zero());
  if (touch_ == Touch::kHand) now_.parts.resize(shape_.parts());
  if (touch_ == Touch::kTrocar) {
    now_.parts.resize(fingers);
    now_.instruments.resize(fingers);
    trocars_ = trocars_of(body.task(), fingers);
    seals_.assign(fingers, SealFriction(instruments.seal_friction_n));
  }
  now_.parts_n.assign(now_.parts.size(), Vector3::Zero());
  seen_ = now_;
  all_poses_.resize(fingers + now_.parts.size());
  all_n_.assign(all_poses_.size(), Vector3::Zero());
}

void HandForces::wrist_at(const std::optional<sim::Pose>& wrist) {
  wrist_ = wrist;
  if (!wrist_) now_.wrist_torque_nm.reset();
}

/// Everything that touches, by where the device's tools are.
void HandForces::place(std::span<const sim::Pose> poses) {
  std::ranges::copy(poses, all_poses_.begin());
  const std::span<sim::Pose> behind = std::span(all_poses_).subspan(poses.size());
  if (touch_ == Touch::kHand) shape_.place(wrist_ ? *wrist_ : HandShape::wrist_behind(poses), poses, behind);
  for (std::size_t i = 0; i < now_.instruments.size(); ++i) {
    InstrumentPlace& instrument = now_.instruments[i].place;
    instrument = instrument_at(trocars_[i], poses[i]);
    all_poses_[i] = instrument_shape_.tip_at(instrument);
    behind[i] = instrument_shape_.shaft_at(instrument);
  }
}

/// What the hand and the wall bear of an instrument that the tissue presses on.
void HandForces::bear(std::size_t i) {
  const Vector3& pivot_m = trocars_[i].pose.position_m;
  const sim::WristForce tip = contact_.tool_force(i, pivot_m),
                        shaft = contact_.tool_force(now_.poses.size() + i, pivot_m);
  Instrument& instrument = now_.instruments[i];
  instrument.forces = levered(instrument.place, tip.force_n + shaft.force_n, tip.torque_nm + shaft.torque_nm,
                              seals_[i].at(instrument.place.depth_m));
  now_.forces_n[i] = instrument.forces.tissue_n;
  now_.peak_wall_n = std::max(now_.peak_wall_n, instrument.forces.wall_n.norm());
}

void HandForces::forces(std::span<const sim::Pose> poses, double period_s, std::span<Vector3> forces_n) {
  place(poses);
  contact_.forces(all_poses_, period_s, all_n_);
  now_.wrist_n.setZero();
  const bool instruments = touch_ == Touch::kTrocar;
  for (std::size_t i = 0; i < forces_n.size(); ++i) {
    if (now_.any) now_.path_m += (all_poses_[i].position_m - now_.poses[i].position_m).norm();
    now_.poses[i] = all_poses_[i];
    now_.forces_n[i] = all_n_[i];
    if (instruments) bear(i);
    const Vector3& felt_n = instruments ? now_.instruments[i].forces.handle_n : now_.forces_n[i];
    now_.wrist_n += felt_n;
    now_.peak_force_n = std::max(now_.peak_force_n, now_.forces_n[i].norm());
    forces_n[i] = played_n(feedback_, all_poses_[i], felt_n);
  }
  for (std::size_t part = 0; part < now_.parts.size(); ++part) {
    now_.parts[part] = all_poses_[poses.size() + part];
    now_.parts_n[part] = all_n_[poses.size() + part];
    if (!instruments) now_.wrist_n += now_.parts_n[part];
  }
  now_.any = true;
  now_.peak_wrist_n = std::max(now_.peak_wrist_n, now_.wrist_n.norm());
  publish();
}

sim::WristForce HandForces::wrist_force(const Vector3& wrist_m) {
  sim::WristForce wrist;
  if (touch_ == Touch::kTrocar) {
    for (const Instrument& instrument : now_.instruments) {
      wrist.force_n += instrument.forces.handle_n;
      wrist.torque_nm += (instrument.place.handle.position_m - wrist_m).cross(instrument.forces.handle_n) +
                         instrument.forces.handle_nm;
    }
  } else {
    wrist = contact_.wrist_force(wrist_m);
  }
  now_.wrist_torque_nm = wrist.torque_nm;
  publish();
  return wrist;
}

void HandForces::publish() {
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (lock.owns_lock()) seen_ = now_;  // as many fingers, so nothing is allocated
}

HandForces::State HandForces::state() const {
  const std::lock_guard lock(mutex_);
  return seen_;
}

}  // namespace kiroku::trainer

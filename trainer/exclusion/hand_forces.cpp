#include "trainer/exclusion/hand_forces.h"

#include <algorithm>
#include <array>
#include <iterator>

#include "base/error.h"

namespace kiroku::trainer {

using sim::Vector3;

namespace {

constexpr std::array<std::array<double, kMostExclusionFingers>, kMostExclusionFingers> kSideBySide{
    {{0}, {-0.03, 0.03}, {-0.04, 0, 0.04}, {-0.05, -0.02, 0.02, 0.05}, {-0.06, -0.03, 0, 0.03, 0.06}}};

void require_fingers(std::size_t count) {
  if (count < 1 || count > kMostExclusionFingers)
    throw UsageError("an organ is pushed aside with 1 to 5 fingers, not " + std::to_string(count));
}

}  // namespace

Feedback feedback_of(const std::string& name) {
  if (name == "full") return Feedback::kFull;
  if (name == "tangential") return Feedback::kTangential;
  throw UsageError("'" + name + "' is no way to play forces: it must be full or tangential");
}

Touch touch_of(const std::string& name) {
  if (name == "fingertips") return Touch::kFingertips;
  if (name == "hand") return Touch::kHand;
  throw UsageError("'" + name + "' is nothing to touch with: it must be fingertips or hand");
}

Vector3 played_n(Feedback feedback, const sim::Pose& pose, const Vector3& force_n) {
  if (feedback == Feedback::kFull) return force_n;
  const Vector3 along = pose.orientation * Vector3::UnitZ();
  return force_n.dot(along) * along;
}

std::vector<sim::ContactTool> fingertips(std::size_t count, double friction) {
  require_fingers(count);
  std::vector<sim::ContactTool> tools;
  for (std::size_t i = 0; i < count; ++i) {
    tools.push_back({"finger " + std::to_string(i + 1), sim::Sphere{kFingertipMetres}});
    if (friction == 0) continue;
    tools.back().sticks = true;
    tools.back().friction = friction;
  }
  return tools;
}

std::span<const double> side_by_side_m(std::size_t fingers) {
  require_fingers(fingers);
  return std::span(kSideBySide[fingers - 1]).first(fingers);
}

bool any_above(double newtons, std::span<const sim::Vector3> forces_n) {
  return std::ranges::any_of(forces_n, [&](const sim::Vector3& force_n) { return force_n.norm() > newtons; });
}

namespace {

std::vector<sim::ContactTool> tools_of(const HandShape& shape, std::size_t fingers, Touch touch,
                                       double friction) {
  std::vector<sim::ContactTool> tools = fingertips(fingers, friction);
  if (touch == Touch::kHand) std::ranges::move(shape.tools(friction), std::back_inserter(tools));
  return tools;
}

}  // namespace

HandForces::HandForces(const ExclusionBody& body, std::size_t fingers, Feedback feedback, Touch touch)
    : shape_(fingers),
      touch_(touch),
      contact_(body.contact(), tools_of(shape_, fingers, touch, body.task().friction)),
      feedback_(feedback) {
  now_.poses.resize(fingers);
  now_.forces_n.assign(fingers, Vector3::Zero());
  if (touch_ == Touch::kHand) {
    now_.parts.resize(shape_.parts());
    now_.parts_n.assign(shape_.parts(), Vector3::Zero());
  }
  seen_ = now_;
  all_poses_.resize(fingers + now_.parts.size());
  all_n_.assign(all_poses_.size(), Vector3::Zero());
}

void HandForces::wrist_at(const std::optional<sim::Pose>& wrist) {
  wrist_ = wrist;
  if (!wrist_) now_.wrist_torque_nm.reset();
}

void HandForces::forces(std::span<const sim::Pose> poses, double period_s, std::span<Vector3> forces_n) {
  std::ranges::copy(poses, all_poses_.begin());
  if (touch_ == Touch::kHand)
    shape_.place(wrist_ ? *wrist_ : HandShape::wrist_behind(poses), poses,
                 std::span(all_poses_).subspan(poses.size()));
  contact_.forces(all_poses_, period_s, all_n_);
  std::ranges::copy(std::span(all_n_).first(forces_n.size()), forces_n.begin());
  now_.wrist_n.setZero();
  for (std::size_t i = 0; i < forces_n.size(); ++i) {
    if (now_.any) now_.path_m += (poses[i].position_m - now_.poses[i].position_m).norm();
    now_.poses[i] = poses[i];
    now_.forces_n[i] = forces_n[i];
    now_.wrist_n += forces_n[i];
    now_.peak_force_n = std::max(now_.peak_force_n, forces_n[i].norm());
    forces_n[i] = played_n(feedback_, poses[i], forces_n[i]);
  }
  for (std::size_t part = 0; part < now_.parts.size(); ++part) {
    now_.parts[part] = all_poses_[poses.size() + part];
    now_.parts_n[part] = all_n_[poses.size() + part];
    now_.wrist_n += now_.parts_n[part];
  }
  now_.any = true;
  now_.peak_wrist_n = std::max(now_.peak_wrist_n, now_.wrist_n.norm());
  publish();
}

sim::WristForce HandForces::wrist_force(const Vector3& wrist_m) {
  const sim::WristForce wrist = contact_.wrist_force(wrist_m);
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

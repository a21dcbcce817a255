#include "trainer/hand/safe_device.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/error.h"
#include "sim/haptics/rate_scheduler.h"
#include "trainer/hand/hand_shape.h"

namespace kiroku::trainer {

using sim::Vector3;

namespace {

/// Devices round, and their poses come unevenly.
constexpr double kJitterMetres = 2e-3;
/// How far from where a pose is what turns with it is still felt: of a fingertip its phalanx, of the wrist
/// the knuckles.
constexpr double kFingertipLeverMetres = HandShape::kDistalMetres,
                 kWristLeverMetres = HandShape::kKnuckleMetres;

/// The way of the pose itself, or of what turns with it at the end of that lever: the longer one.
double way_m(const sim::Pose& from, const sim::Pose& to, double lever_m) {
  return std::max((to.position_m - from.position_m).norm(),
                  lever_m * to.orientation.angularDistance(from.orientation));
}

}  // namespace

SafeDevice::SafeDevice(sim::HapticDevice& device, double period_s, const SafetyLimits& limits)
    : device_(device),
      period_s_(period_s),
      limits_(limits),
      seen_(device.tools()),
      read_(device.tools()),
      given_n_(device.tools(), Vector3::Zero()) {
  const auto positive = [](double value) { return std::isfinite(value) && value > 0; };
  if (!positive(period_s) || !positive(limits.most_force_n) || !positive(limits.most_slope_n_s) ||
      !positive(limits.most_speed_m_s) || !positive(limits.steady_s) || !positive(limits.most_wrist_n) ||
      !positive(limits.most_wrist_slope_n_s) || !positive(limits.most_wrist_nm) ||
      !positive(limits.most_wrist_slope_nm_s))
    throw UsageError("a safe device needs a period and limits that are finite and greater than zero");
}

bool SafeDevice::read(std::span<sim::Pose> poses) {
  if (!device_.read(read_)) return false;
  const bool has_wrist = device_.has_wrist();
  const sim::Pose wrist = has_wrist ? device_.wrist() : sim::Pose();
  const bool sound = std::ranges::all_of(read_, &sim::Pose::sound) && wrist.sound();
  bool jumped = false;
  if (sound && any_seen_) {
    const double reach_m = limits_.most_speed_m_s * std::max(since_seen_s_, period_s_) + kJitterMetres;
    for (std::size_t tool = 0; tool < read_.size(); ++tool)
      jumped = jumped || way_m(seen_[tool], read_[tool], kFingertipLeverMetres) > reach_m;
    jumped = jumped || (has_wrist && wrist_seen_ && way_m(seen_wrist_, wrist, kWristLeverMetres) > reach_m);
  }
  if (!sound) ++faults_.unsound;
  if (jumped) ++faults_.jumps;
  if (!sound || jumped) {
    believes_ = false;
    steady_s_ = 0;
  }
  if (!sound) return false;
  // Where a jump ends is what the next pose is compared with.
  seen_ = read_;
  seen_wrist_ = wrist;
  wrist_seen_ = has_wrist;
  any_seen_ = true;
  since_seen_s_ = 0;
  if (!believes_) return false;
  std::ranges::copy(read_, poses.begin());
  wrist_ = wrist;
  return true;
}

void SafeDevice::approach(Vector3& given, Vector3 wanted, double most, double most_slope) {
  if (!believes_) wanted.setZero();
  if (!wanted.allFinite()) {
    ++faults_.unsound_forces;
    wanted.setZero();
  }
  if (wanted.norm() > most) wanted = most * wanted.stableNormalized();
  const double most_change = most_slope * period_s_;
  const Vector3 change = wanted - given;
  const double size = change.norm();
  given = size <= most_change ? wanted : Vector3(given + most_change / size * change);
}

void SafeDevice::write_wrist(const sim::WristForce& wrist) {
  approach(given_wrist_.force_n, wrist.force_n, limits_.most_wrist_n, limits_.most_wrist_slope_n_s);
  approach(given_wrist_.torque_nm, wrist.torque_nm, limits_.most_wrist_nm, limits_.most_wrist_slope_nm_s);
  device_.write_wrist(given_wrist_);
}

void SafeDevice::write(std::span<const Vector3> forces_n) {
  since_seen_s_ += period_s_;
  if (!believes_) {
    // Silence is no steadiness.
    if (since_seen_s_ <= 2 * period_s_) steady_s_ += period_s_;
    if (steady_s_ >= limits_.steady_s) believes_ = true;
  }
  for (std::size_t tool = 0; tool < given_n_.size(); ++tool)
    approach(given_n_[tool], forces_n[tool], limits_.most_force_n, limits_.most_slope_n_s);
  device_.write(given_n_);
}

void SafeDevice::come_to_rest() {
  const std::vector<Vector3> none(given_n_.size(), Vector3::Zero());
  sim::MonotonicClock clock;
  const auto period = std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * period_s_));
  const auto felt = [&] {
    const bool at_wrist = !given_wrist_.force_n.isZero(0) || !given_wrist_.torque_nm.isZero(0);
    return (has_wrist() && at_wrist) ||
           std::ranges::any_of(given_n_, [](const Vector3& f) { return !f.isZero(0); });
  };
  for (auto due = clock.now(); felt(); due += period) {
    clock.sleep_until(due);
    if (has_wrist()) write_wrist({});
    write(none);
  }
}

}  // namespace kiroku::trainer

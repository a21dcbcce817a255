#include "trainer/hand/safe_device.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/error.h"
#include "sim/haptics/rate_scheduler.h"

namespace kiroku::trainer {

using sim::Vector3;

namespace {

/// Devices round, and their poses come unevenly.
constexpr double kJitterMetres = 2e-3;

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
      !positive(limits.most_speed_m_s) || !positive(limits.steady_s))
    throw UsageError("a safe device needs a period and limits that are finite and greater than zero");
}

bool SafeDevice::read(std::span<sim::Pose> poses) {
  if (!device_.read(read_)) return false;
  const bool sound = std::ranges::all_of(read_, &sim::Pose::sound);
  bool jumped = false;
  if (sound && any_seen_) {
    const double reach_m = limits_.most_speed_m_s * std::max(since_seen_s_, period_s_) + kJitterMetres;
    for (std::size_t tool = 0; tool < read_.size(); ++tool)
      jumped = jumped || (read_[tool].position_m - seen_[tool].position_m).norm() > reach_m;
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
  any_seen_ = true;
  since_seen_s_ = 0;
  if (!believes_) return false;
  std::ranges::copy(read_, poses.begin());
  return true;
}

void SafeDevice::write(std::span<const Vector3> forces_n) {
  since_seen_s_ += period_s_;
  if (!believes_) {
    // Silence is no steadiness.
    if (since_seen_s_ <= 2 * period_s_) steady_s_ += period_s_;
    if (steady_s_ >= limits_.steady_s) believes_ = true;
  }
  const double most_change_n = limits_.most_slope_n_s * period_s_;
  for (std::size_t tool = 0; tool < given_n_.size(); ++tool) {
    Vector3 wanted_n = believes_ ? forces_n[tool] : Vector3::Zero();
    if (!wanted_n.allFinite()) {
      ++faults_.unsound_forces;
      wanted_n.setZero();
    }
    if (wanted_n.norm() > limits_.most_force_n) wanted_n = limits_.most_force_n * wanted_n.stableNormalized();
    const Vector3 change_n = wanted_n - given_n_[tool];
    const double size_n = change_n.norm();
    if (size_n <= most_change_n) {
      given_n_[tool] = wanted_n;
    } else {
      given_n_[tool] += most_change_n / size_n * change_n;
    }
  }
  device_.write(given_n_);
}

void SafeDevice::come_to_rest() {
  const std::vector<Vector3> none(given_n_.size(), Vector3::Zero());
  sim::MonotonicClock clock;
  const auto period = std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * period_s_));
  for (auto due = clock.now(); std::ranges::any_of(given_n_, [](const Vector3& f) { return !f.isZero(0); });
       due += period) {
    clock.sleep_until(due);
    write(none);
  }
}

}  // namespace kiroku::trainer

#include "sim/haptics/force_loop.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>

#include "base/error.h"
#include "sim/haptics/rate_scheduler.h"

namespace kiroku::sim {

using std::chrono::nanoseconds;

ForceLoop::ForceLoop(HapticDevice& device, ForceSource& source, const ForceLoopOptions& options)
    : device_(device), source_(source), options_(options), poses_(device.tools()), forces_n_(device.tools()) {
  if (!(options_.rate_hz >= 1 && options_.rate_hz <= 1e5))
    throw UsageError("a force loop runs at 1 to 100,000 Hz");
  if (options_.real_time_priority < 0 || options_.real_time_priority > 99)
    throw UsageError("a real-time priority is 1 to 99, or 0 for none");
  if (!(options_.most_force_n > 0) || !(options_.most_wrist_n > 0) || !(options_.most_wrist_nm > 0))
    throw UsageError("the largest forces and the largest torque must be greater than zero");
  std::ranges::fill(forces_n_, Vector3::Zero());
  thread_ = std::thread([this] { run(); });
}

ForceLoop::~ForceLoop() {
  ending_ = true;
  if (thread_.joinable()) thread_.join();
}

void ForceLoop::stop() {
  ending_ = true;
  if (thread_.joinable()) thread_.join();
  rethrow_failure();
}

void ForceLoop::rethrow_failure() const {
  const std::lock_guard lock(failure_mutex_);
  if (failure_) std::rethrow_exception(failure_);
}

/// Asks the system for what a thread needs that must not be late.
void ForceLoop::prepare_thread() {
  if (options_.lock_memory) memory_locked_ = ::mlockall(MCL_CURRENT | MCL_ONFAULT) == 0;
  // The part of its stack that steps use is there before the first of them.
  constexpr std::size_t kStackBytes = 128 << 10, kPageBytes = 4096;
  std::array<std::byte, kStackBytes> stack;
  for (std::size_t at = 0; at < kStackBytes; at += kPageBytes)
    *static_cast<volatile std::byte*>(&stack[at]) = std::byte{0};
  if (options_.real_time_priority > 0) {
    const sched_param priority{options_.real_time_priority};
    real_time_ = ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &priority) == 0;
  }
  // Threads without it are woken up to 50 us late, so that the processor sleeps longer.
  ::prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL);
}

void ForceLoop::run() {
  prepare_thread();
  const nanoseconds period(static_cast<std::int64_t>(1e9 / options_.rate_hz));
  const double period_s = std::chrono::duration<double>(period).count();
  MonotonicClock clock;
  try {
    for (nanoseconds due = clock.now(); !ending_; due += period) {
      clock.sleep_until(due);
      const nanoseconds begun = clock.now();
      step(period_s);
      const nanoseconds ended = clock.now();
      jitter_.add(begun - due);
      step_.add(ended - begun);
      ++steps_;
      if (ended <= due + period) {
        ++on_time_;
      } else {
        if (ended - begun <= period) ++late_woken_;
        // Steps that are over are not made up for: they would be of poses that are over.
        const auto over = static_cast<std::uint64_t>((ended - due) / period - 1);
        skipped_ += over;
        due += period * static_cast<std::int64_t>(over);
      }
    }
  } catch (...) {
    const std::lock_guard lock(failure_mutex_);
    failure_ = std::current_exception();
  }
  std::ranges::fill(forces_n_, Vector3::Zero());
  try {
    if (device_.has_wrist()) device_.write_wrist({});
    device_.write(forces_n_);
  } catch (...) {
    const std::lock_guard lock(failure_mutex_);
    if (!failure_) failure_ = std::current_exception();
  }
  running_ = false;
}

void ForceLoop::limit(Vector3& of, double most) {
  const double size = of.norm();
  if (size <= most) return;
  ++limited_;
  // What is no number is no force either.
  of = std::isfinite(size) ? Vector3(of * (most / size)) : Vector3::Zero();
}

void ForceLoop::step(double period_s) {
  const nanoseconds now = std::chrono::steady_clock::now().time_since_epoch();
  if (device_.read(poses_)) {
    pose_at_ = now;
    has_pose_ = true;
  }
  WristForce wrist;
  if (!has_pose_ || now - pose_at_ > options_.pose_timeout) {
    ++without_pose_;
    std::ranges::fill(forces_n_, Vector3::Zero());
  } else {
    source_.wrist_at(device_.has_wrist() ? std::optional(device_.wrist()) : std::nullopt);
    source_.forces(poses_, period_s, forces_n_);
    for (Vector3& force_n : forces_n_) limit(force_n, options_.most_force_n);
    if (device_.has_wrist()) {
      wrist = source_.wrist_force(device_.wrist().position_m);
      limit(wrist.force_n, options_.most_wrist_n);
      limit(wrist.torque_nm, options_.most_wrist_nm);
    }
  }
  if (device_.has_wrist()) device_.write_wrist(wrist);
  device_.write(forces_n_);
}

ForceLoopStatistics ForceLoop::statistics() const {
  rethrow_failure();
  ForceLoopStatistics found;
  found.steps = steps_;
  found.on_time = on_time_;
  found.skipped = skipped_;
  found.late_woken = late_woken_;
  found.without_pose = without_pose_;
  found.limited_forces = limited_;
  found.real_time = real_time_;
  found.memory_locked = memory_locked_;
  found.jitter_50 = jitter_.percentile(0.5);
  found.jitter_99 = jitter_.percentile(0.99);
  found.jitter_999 = jitter_.percentile(0.999);
  found.jitter_longest = jitter_.longest();
  found.step_50 = step_.percentile(0.5);
  found.step_99 = step_.percentile(0.99);
  found.step_999 = step_.percentile(0.999);
  found.step_longest = step_.longest();
  return found;
}

}  // namespace kiroku::sim

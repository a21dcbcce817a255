#include "sim/haptics/rate_scheduler.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <ctime>
#include <utility>

#include "base/error.h"

namespace kiroku::sim {

using std::chrono::nanoseconds;

nanoseconds MonotonicClock::now() { return std::chrono::steady_clock::now().time_since_epoch(); }

void MonotonicClock::sleep_until(nanoseconds time) {
  const timespec until{static_cast<time_t>(time.count() / 1'000'000'000),
                       static_cast<long>(time.count() % 1'000'000'000)};
  while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

RateScheduler::RateScheduler(SchedulerClock& clock, ScheduledWork work, double force_rate_hz)
    : clock_(clock), work_(std::move(work)) {
  if (!(force_rate_hz > 0) || !std::isfinite(force_rate_hz))
    throw UsageError("forces need a rate greater than zero");
  if (!work_.forces || !work_.deformation || !work_.picture)
    throw UsageError("the scheduler needs forces, a deformation and a picture to compute");
  interval_ = nanoseconds(static_cast<std::int64_t>(1e9 / force_rate_hz));
}

void RateScheduler::Estimate::forget() {
  const nanoseconds shrunk(static_cast<std::int64_t>(kForget * static_cast<double>(took.count())));
  took = std::max(shrunk, std::min(took, least));
}

nanoseconds RateScheduler::perform(const std::function<void()>& work, Estimate& estimate,
                                   ScheduleReport::Share& share) {
  const nanoseconds begun = clock_.now();
  work();
  const nanoseconds ended = clock_.now(), took = ended - begun;
  // The longest of late counts: what was quick once may be slow the next time.
  estimate.least = std::min(estimate.least, took);
  estimate.forget();
  estimate.took = std::max(estimate.took, took);
  ++share.times;
  share.spent += took;
  return ended;
}

ScheduleReport RateScheduler::run(nanoseconds budget) {
  ScheduleReport report;
  const nanoseconds begun = clock_.now(), end = begun + budget;
  nanoseconds due = begun, last_forces = begun, now = begun;
  while (now < end) {
    if (now >= due) {
      if (now > due) ++report.late_forces;
      if (report.forces.times > 0)
        report.longest_between_forces = std::max(report.longest_between_forces, now - last_forces);
      last_forces = now;
      // Late forces are not made up for: a hand cannot feel them any more.
      due = now + interval_;
      now = perform(work_.forces, forces_, report.forces);
      continue;
    }
    bool worked = false;
    for (int turn = 0; turn < 2 && !worked; ++turn) {
      const bool picture = picture_next_;
      Estimate& estimate = picture ? picture_ : deformation_;
      picture_next_ = !picture_next_;
      if (now + estimate.took > std::min(due, end)) {
        estimate.forget();
        continue;
      }
      now = perform(picture ? work_.picture : work_.deformation, estimate,
                    picture ? report.pictures : report.deformation);
      worked = true;
    }
    if (worked) continue;
    clock_.sleep_until(std::min(due, end));
    const nanoseconds woke = clock_.now();
    report.idle += woke - now;
    now = woke;
  }
  report.elapsed = now - begun;
  const double seconds = std::chrono::duration<double>(report.elapsed).count();
  for (ScheduleReport::Share* share : {&report.forces, &report.deformation, &report.pictures})
    share->rate_hz = seconds > 0 ? static_cast<double>(share->times) / seconds : 0;
  return report;
}

}  // namespace kiroku::sim

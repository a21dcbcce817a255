#include "recorder/clock/clock_watch.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <sys/timex.h>
#include <utility>

namespace kiroku::recorder {
namespace {

constexpr std::int64_t kEntryIntervalNs = 60'000'000'000;
constexpr std::int64_t kBillion = 1'000'000'000;
// Two readings of a clock take some dozen nanoseconds; an interruption in between takes longer than this.
constexpr std::int64_t kGoodReadingNs = 5'000;
constexpr int kMostReadings = 10;
// A slew has ended below three quarters of the rate that it begins at, so that one near it does not flicker.
constexpr std::int64_t kEndedPpb = archive::kSlewPpb * 3 / 4;
// The part of a stated rate that it may differ by before it is stated again.
constexpr std::int64_t kNewRateDivisor = 5;

/// Of a time, at a rate, rounded.
std::int64_t part_of(std::int64_t elapsed_ns, std::int64_t ppb) {
  return static_cast<std::int64_t>(
      std::llround(static_cast<double>(elapsed_ns) * static_cast<double>(ppb) / kBillion));
}

std::int64_t read(clockid_t clock) {
  timespec time{};
  ::clock_gettime(clock, &time);
  return time.tv_sec * kBillion + time.tv_nsec;
}

/// How much more the case clock went on than the crystal did.
std::int64_t gain_ns(const ClockReading& since, const ClockReading& now) {
  return (now.case_ns - since.case_ns) - (now.raw_ns - since.raw_ns);
}

}  // namespace

ClockReading read_clocks(const CaseClock& clock) {
  ClockReading best;
  for (int i = 0; i < kMostReadings; ++i) {
    const std::int64_t before_ns = clock.now_ns();
    ClockReading reading;
    reading.wall_ns = read(CLOCK_REALTIME);
    const std::chrono::nanoseconds slept = clock.time().since_boot() - clock.time().now().time_since_epoch();
    reading.raw_ns = read(CLOCK_MONOTONIC_RAW) + slept.count();
    const std::int64_t after_ns = clock.now_ns();
    reading.case_ns = before_ns + (after_ns - before_ns) / 2;
    reading.uncertainty_ns = after_ns - before_ns;
    if (i == 0 || reading.uncertainty_ns < best.uncertainty_ns) best = reading;
    if (best.uncertainty_ns <= kGoodReadingNs) break;
  }
  return best;
}

KernelClock read_kernel_clock() {
  timex state{};  // modes 0: only asks
  const int status = ::adjtimex(&state);
  KernelClock kernel;
  kernel.synchronised = status >= 0 && status != TIME_ERROR && (state.status & STA_UNSYNC) == 0;
  kernel.offset_ns = state.offset * ((state.status & STA_NANO) != 0 ? 1 : 1000);
  kernel.error_ns = state.maxerror * 1000;
  return kernel;
}

ClockWatch::ClockWatch(const CaseClock& clock)
    : ClockWatch({[&clock] { return read_clocks(clock); }, read_kernel_clock}) {}

ClockWatch::ClockWatch(Clocks clocks) : clocks_(std::move(clocks)) {}

std::optional<archive::ClockEntry> ClockWatch::check() {
  const ClockReading now = clocks_.read();
  look(now);
  if (!stated_) return entry(now, 0, now);
  const std::int64_t step_ns = (now.wall_ns - now.case_ns) - (stated_->wall_ns - stated_->case_ns);
  const bool stepped = std::abs(step_ns) > kSmallestStepNs + now.uncertainty_ns + stated_->uncertainty_ns;
  const bool due = stepped || now.case_ns - stated_->case_ns >= kEntryIntervalNs;
  if (!due && !(slew_is_news(now) && may_state_slew(now))) return {};
  const bool begins = slewing_ && !stated_slewing_;
  return entry(now, stepped ? step_ns : 0, begins ? window_.front() : *stated_);
}

void ClockWatch::look(const ClockReading& now) {
  window_.push_back(now);
  while (window_.size() > 2 && now.raw_ns - window_[1].raw_ns >= kWindowNs) window_.pop_front();
  const ClockReading& since = window_.front();
  const std::int64_t elapsed_ns = now.raw_ns - since.raw_ns;
  if (elapsed_ns < kWindowNs) return;
  const std::int64_t gained_ns = std::abs(gain_ns(since, now));
  const std::int64_t doubt_ns = now.uncertainty_ns + since.uncertainty_ns;
  slewing_ = slewing_ ? gained_ns + doubt_ns >= part_of(elapsed_ns, kEndedPpb)
                      : gained_ns - doubt_ns > part_of(elapsed_ns, archive::kSlewPpb);
}

bool ClockWatch::slew_is_news(const ClockReading& now) const {
  if (slewing_ != stated_slewing_) return true;
  const ClockReading& since = window_.front();
  if (!slewing_ || since.raw_ns < stated_->raw_ns) return false;
  if (stated_beginning_) return true;
  const std::int64_t elapsed_ns = now.raw_ns - since.raw_ns;
  const std::int64_t doubt_ns = now.uncertainty_ns + since.uncertainty_ns;
  const std::int64_t differs_ns = std::abs(gain_ns(since, now) - part_of(elapsed_ns, stated_ppb_));
  return differs_ns - doubt_ns > part_of(elapsed_ns, std::abs(stated_ppb_)) / kNewRateDivisor;
}

bool ClockWatch::may_state_slew(const ClockReading& now) {
  slews_paid_until_ns_ = std::max(slews_paid_until_ns_, now.raw_ns - kMostSlewsAtOnce * kSlewEveryNs);
  if (slews_paid_until_ns_ + kSlewEveryNs > now.raw_ns) return false;
  slews_paid_until_ns_ += kSlewEveryNs;
  return true;
}

archive::ClockEntry ClockWatch::entry(const ClockReading& now, std::int64_t step_ns,
                                      const ClockReading& rate_since) {
  const KernelClock kernel = clocks_.kernel();
  archive::ClockEntry entry;
  entry.synchronised = kernel.synchronised;
  entry.offset_ns = kernel.offset_ns;
  entry.error_ns = kernel.error_ns;
  entry.step_ns = step_ns;
  if (const std::int64_t elapsed_ns = now.raw_ns - rate_since.raw_ns; elapsed_ns > 0) {
    entry.rate_ppb = std::llround(static_cast<double>(gain_ns(rate_since, now)) * kBillion /
                                  static_cast<double>(elapsed_ns));
  }
  stated_ = now;
  stated_beginning_ = slewing_ && !stated_slewing_;
  stated_slewing_ = slewing_;
  stated_ppb_ = entry.rate_ppb.value_or(0);
  return entry;
}

}  // namespace kiroku::recorder

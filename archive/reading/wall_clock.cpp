#include "archive/reading/wall_clock.h"

#include <algorithm>
#include <chrono>

namespace kiroku::archive {
namespace {

using std::chrono::microseconds;

constexpr std::int64_t kNsPerUs = 1'000;
// A time of another century is as good as one of 146 years away: nanoseconds count no further.
constexpr std::int64_t kFarthestNs = std::int64_t{1} << 62, kFarthestUs = kFarthestNs / kNsPerUs;

std::int64_t clamped(std::int64_t us) { return std::clamp(us, -kFarthestUs, kFarthestUs); }

}  // namespace

WallClock::WallClock(const Moment& opened, std::vector<Step> steps)
    : opened_(opened), steps_(std::move(steps)) {
  opened_.mono_ns = std::clamp<std::int64_t>(opened_.mono_ns, 0, kFarthestNs - 1);
  std::erase_if(steps_, [](const Step& step) { return step.step_ns == 0; });
  std::ranges::stable_sort(steps_, {}, &Step::mono_ns);
  for (const Step& step : steps_)
    offsets_us_.push_back(clamped(offsets_us_.back() + step.step_ns / kNsPerUs));
}

UtcTime WallClock::shown(std::int64_t case_ns, std::size_t steps_before) const {
  const std::int64_t since_us = (case_ns - opened_.mono_ns) / kNsPerUs;
  return opened_.utc + microseconds(clamped(clamped(since_us) + offsets_us_[steps_before]));
}

UtcTime WallClock::at(std::int64_t case_ns) const {
  const auto behind = std::ranges::upper_bound(steps_, case_ns, {}, &Step::mono_ns);
  return shown(case_ns, static_cast<std::size_t>(behind - steps_.begin()));
}

std::vector<std::int64_t> WallClock::case_times(UtcTime utc) const {
  const std::int64_t since_us = clamped((utc - opened_.utc).count());
  std::vector<std::int64_t> times;
  for (std::size_t i = 0; i <= steps_.size(); ++i) {
    const std::int64_t time_ns = opened_.mono_ns + clamped(since_us - offsets_us_[i]) * kNsPerUs;
    const bool is_behind = i == 0 || time_ns >= steps_[i - 1].mono_ns;
    const bool is_before = i == steps_.size() || time_ns < steps_[i].mono_ns;
    if (is_behind && is_before) times.push_back(time_ns);
  }
  return times;
}

const WallClock::Step* WallClock::step_over(UtcTime utc) const {
  for (const Step& step : steps_) {
    const auto [before, behind] = around(step);
    if (before <= utc && utc < behind) return &step;
  }
  return nullptr;
}

std::pair<UtcTime, UtcTime> WallClock::around(const Step& step) const {
  const auto index = static_cast<std::size_t>(&step - steps_.data());
  return {shown(step.mono_ns, index), shown(step.mono_ns, index + 1)};
}

}  // namespace kiroku::archive

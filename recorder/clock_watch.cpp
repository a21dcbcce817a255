#include "recorder/clock_watch.h"

#include <chrono>
#include <cstdlib>
#include <sys/timex.h>

namespace kiroku::recorder {
namespace {

constexpr std::int64_t kEntryIntervalNs = 60'000'000'000;
constexpr std::int64_t kSmallestStepNs = 100'000'000;

}  // namespace

ClockWatch::ClockWatch(const CaseClock& clock) : clock_(clock), last_difference_ns_(wall_minus_case_ns()) {}

std::int64_t ClockWatch::wall_minus_case_ns() const {
  const auto wall = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(wall).count() - clock_.now_ns();
}

std::optional<archive::ClockEntry> ClockWatch::check() {
  const std::int64_t difference = wall_minus_case_ns();
  const std::int64_t step = difference - last_difference_ns_;
  last_difference_ns_ = difference;
  const bool stepped = std::abs(step) > kSmallestStepNs;
  const std::int64_t now = clock_.now_ns();
  if (last_entry_ns_ && now - *last_entry_ns_ < kEntryIntervalNs && !stepped) return {};
  last_entry_ns_ = now;

  timex state{};  // modes 0: only asks
  const int status = ::adjtimex(&state);
  const std::int64_t unit = (state.status & STA_NANO) != 0 ? 1 : 1000;
  archive::ClockEntry entry;
  entry.synchronised = status >= 0 && status != TIME_ERROR && (state.status & STA_UNSYNC) == 0;
  entry.offset_ns = state.offset * unit;
  entry.error_ns = state.maxerror * 1000;
  entry.step_ns = stepped ? step : 0;
  return entry;
}

}  // namespace kiroku::recorder

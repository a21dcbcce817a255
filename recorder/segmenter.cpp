#include "recorder/segmenter.h"

#include <algorithm>

#include "recorder/lane.h"

namespace kiroku::recorder {
namespace {

// A segment lasts at most 10 s, so a silence that would stretch it further is stated as a gap.
constexpr std::int64_t kLongestSegmentNs = 10'000'000'000;
constexpr std::int64_t kLongestSilenceNs = 5'000'000'000;
constexpr std::int64_t kShortestSilenceNs = 1'000'000'000;

Gap gap(std::int64_t start_ns, std::int64_t end_ns, archive::GapCause cause) {
  return {{std::min(start_ns, end_ns), end_ns}, cause};
}

}  // namespace

std::int64_t longest_silence_ns(std::chrono::nanoseconds segment_duration, bool after_a_frame) {
  if (!after_a_frame) return kShortestSilenceNs;
  return std::clamp(kLongestSegmentNs - segment_duration.count(), kShortestSilenceNs, kLongestSilenceNs);
}

void Segmenter::segment_began(std::int64_t start_ns) {
  boundary_ns_ = next_boundary(start_ns, rules_.duration);
}

void Segmenter::frame_recorded(std::int64_t time_ns, std::int64_t interval_ns) {
  last_frame_ns_ = time_ns;
  interval_ns_ = std::min(interval_ns, kLongestShownNs);
}

void Segmenter::absent(archive::GapCause cause) {
  if (!absence_) absence_ = Absence{recorded_until_ns_, cause};
}

void Segmenter::failed(std::int64_t since_ns, archive::GapCause cause) {
  recorded_until_ns_ = since_ns;
  absence_ = Absence{since_ns, cause};
}

bool Segmenter::silent_before(std::int64_t time_ns, std::int64_t now_ns) const {
  return !absence_ && time_ns - end_of_last_frame(now_ns) > longest_silence_ns(rules_.duration, has_frames());
}

bool Segmenter::cuts_at(std::int64_t time_ns, std::uint64_t bytes) const {
  return time_ns >= boundary_ns_ || bytes >= rules_.largest_bytes;
}

std::optional<Gap> Segmenter::gap_before(std::int64_t time_ns) {
  if (!absence_) return {};
  const Absence ended = *absence_;
  absence_.reset();
  return gap(ended.since_ns, time_ns, ended.cause);
}

std::optional<Gap> Segmenter::gap_at_close(std::int64_t close_ns, std::int64_t now_ns,
                                           bool reached_end) const {
  std::optional<Absence> missing = absence_;
  if (!missing && !has_frames()) missing = Absence{};
  const std::int64_t last_ns = std::min(close_ns, rules_.end_ns.value_or(close_ns));
  const bool silent =
      rules_.timed_by_arrival && !reached_end && last_ns - end_of_last_frame(now_ns) > kShortestSilenceNs;
  if (!missing && silent) missing = Absence{recorded_until_ns_, archive::GapCause::kSignalLost};
  // The time to record is over, and another stream's film is still being coded.
  const bool waits = rules_.timed_by_arrival && close_ns - last_ns > kLongestUnstatedEndNs;
  if (!missing && waits) missing = Absence{recorded_until_ns_, archive::GapCause::kPaused};
  if (!missing) return {};
  return gap(missing->since_ns, std::max(close_ns, missing->since_ns), missing->cause);
}

std::int64_t Segmenter::end_of_last_frame(std::int64_t now_ns, std::optional<std::int64_t> next_ns) const {
  if (!has_frames()) return 0;
  std::int64_t latest = std::min(rules_.end_ns.value_or(INT64_MAX), next_ns.value_or(INT64_MAX));
  if (rules_.timed_by_arrival) latest = std::min(latest, now_ns);
  return std::max(std::min(last_frame_ns_ + interval_ns_, latest), last_frame_ns_ + 1);
}

std::optional<std::int64_t> Pace::refused_until(std::int64_t time_ns) {
  if (times_.size() == most_) {
    const std::int64_t free_ns = times_.front() + within_ns_;
    if (time_ns < free_ns) return free_ns;
    times_.pop_front();
  }
  times_.push_back(time_ns);
  return {};
}

std::size_t Pace::counted(std::int64_t time_ns) const {
  return static_cast<std::size_t>(
      std::ranges::count_if(times_, [&](std::int64_t each) { return time_ns - each < within_ns_; }));
}

}  // namespace kiroku::recorder

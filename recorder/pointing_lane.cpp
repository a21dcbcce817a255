#include "recorder/pointing_lane.h"

#include <algorithm>
#include <utility>

#include "base/error.h"

namespace kiroku::recorder {

PointingLane::PointingLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info)
    : clock_(context.clock),
      segments_(context, stream_index, std::move(info),
                [&problems = context.problems](const std::exception& error) {
                  problems.report(std::string("where people point is recorded no more: ") + error.what());
                }) {}

void PointingLane::begin(std::int64_t begins_ns) {
  const std::lock_guard guard(mutex_);
  segments_.begin(begins_ns);
  open_ = true;
}

std::optional<std::int64_t> PointingLane::add(media::PointedAt at) {
  const std::lock_guard guard(mutex_);
  if (!open_) return {};
  // With the mutex held, so that lines stand in the order of their times.
  const std::int64_t now_ns = clock_.now_ns();
  if (waiting_.size() >= kMostWaiting) {
    ++dropped_;
  } else {
    waiting_.push_back(media::pointing_line({now_ns, std::move(at)}));
  }
  return now_ns;
}

void PointingLane::step(std::int64_t now_ns) {
  std::vector<std::string> lines;
  std::uint64_t dropped = 0;
  {
    const std::lock_guard guard(mutex_);
    lines.swap(waiting_);
    dropped = std::exchange(dropped_, 0);
    now_ns = std::max(now_ns, clock_.now_ns());
  }
  segments_.seal(lines, dropped, now_ns);
}

void PointingLane::finish(std::int64_t close_ns) {
  {
    const std::lock_guard guard(mutex_);
    open_ = false;
  }
  step(close_ns);
  segments_.finish(close_ns);
}

}  // namespace kiroku::recorder

// Where people point on the live pictures of a case: one sealed line each (media/pointing_line.h).
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "media/pointing_line.h"
#include "recorder/line_segments.h"

namespace kiroku::recorder {

/// Whatever goes wrong with pointing ends no recording: its stream states a gap, and the rest goes on.
class PointingLane {
 public:
  /// So many lines wait at most to be sealed: some seconds of ten people. What comes beyond is counted as
  /// dropped in the next segment's entry.
  static constexpr std::size_t kMostWaiting = 2000;

  PointingLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info);
  /// As LineSegments::begin().
  void begin(std::int64_t begins_ns);
  /// From any thread; never waits for a disk. The time it has in the case; nothing before the case has begun
  /// and after it has ended.
  std::optional<std::int64_t> add(media::PointedAt at);
  /// By the session's thread, as of EventsLane.
  void step(std::int64_t now_ns);
  void finish(std::int64_t close_ns);

 private:
  const CaseClock& clock_;
  LineSegments segments_;
  std::mutex mutex_;  // guards the following
  std::vector<std::string> waiting_;
  std::uint64_t dropped_ = 0;
  bool open_ = false;
};

}  // namespace kiroku::recorder

// Lines that come now and then, sealed in segments that follow one another: each reaches from where the one
// before ended to when it is sealed. Used by one thread but for begin(), which comes before the first line.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "recorder/lane.h"
#include "recorder/stream_output.h"

namespace kiroku::recorder {

class LineSegments {
 public:
  /// `failed` hears once why nothing more can be sealed; then everything is left out, and finish() states the
  /// gap.
  using Failed = std::function<void(const std::exception& error)>;
  LineSegments(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info, Failed failed);

  /// The case begins at this time of its clock (0 unless it begins with what was recorded before).
  void begin(std::int64_t begins_ns) { sealed_until_ns_ = begins_ns; }
  /// Lines with their LF; without any nothing is written. `dropped` were not taken since the last segment.
  void seal(const std::vector<std::string>& lines, std::uint64_t dropped, std::int64_t now_ns);
  /// Waits until everything is durable and stated.
  void finish(std::int64_t close_ns);

 private:
  void fail(const std::exception& error);
  LaneContext context_;
  StreamOutput output_;
  const Failed failed_;
  std::int64_t sealed_until_ns_ = 0;
  std::optional<archive::GapCause> gap_cause_;
};

}  // namespace kiroku::recorder

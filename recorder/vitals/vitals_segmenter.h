// Cuts a stream of vital signs into segments at whole multiples of the segment duration on the case clock. An
// object belongs to one thread.
#pragma once

#include <chrono>
#include <cstdint>

#include "base/bytes.h"
#include "media/vital_line.h"

namespace kiroku::recorder {

/// Receives the pieces, always begin, write*, end. Segment spans join without a hole: a segment in which no
/// sample arrived is still begun and ended, with no line in it. Errors thrown here pass through the
/// segmenter, which then is good for nothing more.
class VitalsSegmentSink {
 public:
  virtual ~VitalsSegmentSink() = default;
  virtual void begin_segment(std::uint64_t index, std::int64_t start_ns) = 0;
  /// One or more whole lines, each with its LF.
  virtual void write(ByteView lines) = 0;
  virtual void end_segment(std::int64_t end_ns, std::uint64_t samples) = 0;
};

class VitalsSegmenter {
 public:
  /// `sink` must outlive the object. The first segment begins at `first_start_ns`, all others at whole
  /// multiples of `duration`. Throws kiroku::UsageError if the duration is not positive.
  VitalsSegmenter(VitalsSegmentSink& sink, std::chrono::nanoseconds duration,
                  std::int64_t first_start_ns = 0);

  /// Adds a line, after ending the segments that lie before it. Lines must come in order of time and not
  /// before the last advance_to(); throws kiroku::Error else.
  void add(const media::VitalLine& line);
  /// Nothing with time_ns < `now_ns` will come any more: ends the segments that lie wholly before.
  void advance_to(std::int64_t now_ns);
  /// What lies before `from_ns` ends in a segment of its own, where nothing with time_ns < `next_ns` will
  /// come any more and `next_ns` is not before it: at `from_ns`, or just after the last line if that is
  /// later.
  void split(std::int64_t from_ns, std::int64_t next_ns);
  /// Nothing was recorded from the last advance_to() or line until `until_ns`: the open segment ends before,
  /// the next one begins then. Where what was recorded ends; `until_ns` must not be before that.
  std::int64_t pass_over(std::int64_t until_ns);
  /// Ends the last segment at `end_ns`, or just after the last sample if that is later. Nothing may follow.
  void finish(std::int64_t end_ns);

  /// No line before it is taken any more.
  [[nodiscard]] std::int64_t floor_ns() const { return floor_ns_; }
  /// Where the segment begins that is open, or the next one.
  [[nodiscard]] std::int64_t start_ns() const { return start_ns_; }
  [[nodiscard]] std::uint64_t samples() const { return samples_; }
  [[nodiscard]] std::uint64_t segments() const { return next_index_; }

 private:
  void begin_if_needed();
  void end_at(std::int64_t end_ns);

  VitalsSegmentSink& sink_;
  std::int64_t duration_ns_;
  std::int64_t start_ns_;  // of the segment that is open, or the next one
  std::int64_t floor_ns_;  // no sample before it is taken any more
  bool open_ = false;
  bool finished_ = false;
  std::uint64_t next_index_ = 0, samples_ = 0, segment_samples_ = 0;
};

}  // namespace kiroku::recorder

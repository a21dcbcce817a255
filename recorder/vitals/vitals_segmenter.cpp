#include "recorder/vitals/vitals_segmenter.h"

#include <algorithm>

#include "base/error.h"

namespace kiroku::recorder {

VitalsSegmenter::VitalsSegmenter(VitalsSegmentSink& sink, std::chrono::nanoseconds duration,
                                 std::int64_t first_start_ns)
    : sink_(sink), duration_ns_(duration.count()), start_ns_(first_start_ns), floor_ns_(first_start_ns) {
  if (duration_ns_ <= 0 || first_start_ns < 0) {
    throw UsageError("a segment of vital signs must last longer than nothing and begin within the case");
  }
}

// Begun only when there is something to say about it, so that none of length zero is left at the end.
void VitalsSegmenter::begin_if_needed() {
  if (!open_) {
    sink_.begin_segment(next_index_++, start_ns_);
    segment_samples_ = 0;
    open_ = true;
  }
}

void VitalsSegmenter::end_at(std::int64_t end_ns) {
  begin_if_needed();
  sink_.end_segment(end_ns, segment_samples_);
  start_ns_ = end_ns;
  open_ = false;
}

void VitalsSegmenter::advance_to(std::int64_t now_ns) {
  if (finished_ || now_ns < floor_ns_) {
    throw Error("a stream of vital signs went back in time, or on after its end; its source is at fault");
  }
  floor_ns_ = now_ns;
  for (;;) {
    const std::int64_t boundary_ns = (start_ns_ / duration_ns_ + 1) * duration_ns_;
    if (boundary_ns > now_ns) {
      return;
    }
    end_at(boundary_ns);
  }
}

void VitalsSegmenter::split(std::int64_t from_ns, std::int64_t next_ns) {
  // Lines of one moment stay together: nothing of the last one may follow.
  if (finished_ || start_ns_ >= from_ns || next_ns < from_ns || next_ns <= floor_ns_) return;
  const std::int64_t end_ns = std::max(from_ns, floor_ns_ + 1);
  advance_to(end_ns);
  if (start_ns_ < end_ns) end_at(end_ns);
}

void VitalsSegmenter::add(const media::VitalLine& line) {
  advance_to(media::time_ns_of(line));
  std::string text;
  try {
    text = media::to_json_line(line) + '\n';
  } catch (const Error& error) {
    // A line that the format cannot hold costs itself, not the stream; the monitor's message stands before
    // it.
    text =
        media::to_json_line(media::VitalNotice{media::time_ns_of(line), "line-left-out", error.what(), ""}) +
        '\n';
  }
  begin_if_needed();
  sink_.write(bytes_of(text));
  ++segment_samples_;
  ++samples_;
}

std::int64_t VitalsSegmenter::pass_over(std::int64_t until_ns) {
  // A segment with a sample spans at least that sample's instant.
  const std::int64_t end_ns = open_ && segment_samples_ > 0 ? floor_ns_ + 1 : floor_ns_;
  if (finished_ || until_ns < end_ns) {
    throw Error("a stream of vital signs went back in time, or on after its end; its source is at fault");
  }
  if (open_ || end_ns > start_ns_) end_at(end_ns);
  start_ns_ = floor_ns_ = until_ns;
  return end_ns;
}

void VitalsSegmenter::finish(std::int64_t end_ns) {
  // A segment with a sample spans at least that sample's instant.
  const std::int64_t last_ns = std::max(end_ns, open_ && segment_samples_ > 0 ? floor_ns_ + 1 : floor_ns_);
  advance_to(last_ns);
  finished_ = true;
  if (open_ || last_ns > start_ns_) {
    end_at(last_ns);
  }
}

}  // namespace kiroku::recorder

#include "recorder/frame_queue.h"

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/imgutils.h>
#include <libavutil/samplefmt.h>
}

#include <algorithm>
#include <utility>

namespace kiroku::recorder {
namespace {

// More than three holes a second: the machine is too slow for long. In one long hole no more is lost then
// than in many short ones.
constexpr std::size_t kManyGaps = 24;

}  // namespace

std::size_t frame_bytes(const AVFrame& frame) {
  const auto format = frame.format;
  const int bytes =
      frame.nb_samples > 0
          ? av_samples_get_buffer_size(nullptr, frame.ch_layout.nb_channels, frame.nb_samples,
                                       static_cast<AVSampleFormat>(format), 1)
          : av_image_get_buffer_size(static_cast<AVPixelFormat>(format), frame.width, frame.height, 1);
  return std::max(static_cast<std::size_t>(std::max(bytes, 0)), kLeastFrameBytes);
}

bool FrameQueue::push(TimedFrame frame, bool patient) {
  const std::size_t bytes = frame_bytes(*frame.frame);
  const std::int64_t time_ns = frame.time_ns;
  std::unique_lock lock(mutex_);
  // A picture larger than the whole budget still fits into an empty queue.
  const auto has_room = [&] {
    return abandoned_ || items_.empty() || waiting_bytes_ + bytes <= budget_bytes_;
  };
  if (patient) changed_.wait(lock, has_room);
  if (abandoned_) return false;
  // What the source lost lay between the frame before and this one, evenly.
  const auto lost = static_cast<std::int64_t>(frame.lost_before);
  dropped_ += frame.lost_before;
  if (lost > 0 && dropped_before_next_ == 0) {
    first_dropped_ns_ = last_taken_ns_ + (time_ns - last_taken_ns_) / (lost + 1);
  }
  if (lost > 0 && (dropped_before_next_ == 0 || !frame.lost_on_the_way)) {
    dropped_cause_ = frame.lost_on_the_way ? archive::GapCause::kSignalLost : archive::GapCause::kOverload;
  }
  dropped_before_next_ += frame.lost_before;
  const bool is_full = !has_room();
  if (is_full && frame.is_sound) return false;  // silence fills the hole
  if (is_full || (!frame.is_sound && prolongs_hole(time_ns))) {
    if (is_full) {
      dropped_cause_ = archive::GapCause::kOverload;
      empties_ = empties_ || gaps_.counted(time_ns) >= kManyGaps;
    }
    if (dropped_before_next_++ == 0) first_dropped_ns_ = time_ns;
    ++dropped_;
    return false;
  }
  if (frame.is_sound) {
    items_.emplace_back(QueuedAudio{std::move(frame)});
  } else {
    items_.emplace_back(QueuedFrame{std::move(frame), std::exchange(dropped_before_next_, 0),
                                    first_dropped_ns_, dropped_cause_});
    last_taken_ns_ = time_ns;
  }
  waiting_bytes_ += bytes;
  lock.unlock();
  changed_.notify_all();
  return true;
}

bool FrameQueue::prolongs_hole(std::int64_t time_ns) {
  if (dropped_before_next_ == 0) return false;
  if (empties_ && !items_.empty()) return true;
  empties_ = false;
  Pace& pace = dropped_cause_ == archive::GapCause::kOverload ? static_cast<Pace&>(gaps_) : losses_;
  return pace.refused_until(time_ns).has_value();
}

void FrameQueue::push(SourceLost lost) {
  {
    const std::lock_guard guard(mutex_);
    items_.emplace_back(lost);
  }
  changed_.notify_all();
}

void FrameQueue::push(AudioLost lost) {
  {
    const std::lock_guard guard(mutex_);
    items_.emplace_back(lost);
  }
  changed_.notify_all();
}

void FrameQueue::finish() {
  {
    const std::lock_guard guard(mutex_);
    finished_ = true;
  }
  changed_.notify_all();
}

std::optional<QueueItem> FrameQueue::pop() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return finished_ || !items_.empty(); });
  if (items_.empty()) return {};
  QueueItem item = std::move(items_.front());
  items_.pop_front();
  if (const auto* frame = std::get_if<QueuedFrame>(&item)) {
    waiting_bytes_ -= frame_bytes(*frame->frame.frame);
  } else if (const auto* audio = std::get_if<QueuedAudio>(&item)) {
    waiting_bytes_ -= frame_bytes(*audio->audio.frame);
  }
  lock.unlock();
  changed_.notify_all();
  return item;
}

void FrameQueue::abandon() {
  {
    const std::lock_guard guard(mutex_);
    abandoned_ = true;
    items_.clear();
    waiting_bytes_ = 0;
  }
  changed_.notify_all();
}

std::uint64_t FrameQueue::dropped() const {
  const std::lock_guard guard(mutex_);
  return dropped_;
}

std::optional<QueuedFrame> FrameQueue::unstated_drops() {
  const std::lock_guard guard(mutex_);
  if (dropped_before_next_ == 0) return {};
  QueuedFrame item;
  item.dropped_before = std::exchange(dropped_before_next_, 0);
  item.dropped_since_ns = first_dropped_ns_;
  item.dropped_cause = dropped_cause_;
  return item;
}

}  // namespace kiroku::recorder

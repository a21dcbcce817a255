// Between a capture thread and its encoder: bounded in bytes, so that a slow encoder or disk costs frames and
// never memory or the camera's time.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <variant>

#include "archive/format/ledger_entry.h"
#include "recorder/segmenter.h"
#include "recorder/source/source.h"

namespace kiroku::recorder {

/// A picture, with what was lost right before it: for want of room, or by the source itself.
struct QueuedFrame {
  TimedFrame frame;
  std::uint64_t dropped_before = 0;
  std::int64_t dropped_since_ns = 0;  // case clock; until the frame's own time nothing was taken
  archive::GapCause dropped_cause = archive::GapCause::kOverload;
};
struct QueuedAudio {
  TimedFrame audio;
};
/// The source went away after the last frame.
struct SourceLost {
  archive::GapCause cause = archive::GapCause::kSignalLost;
  std::int64_t time_ns = 0;  // case clock; what comes next was taken later
};
/// Audio that comes from a device of its own is missing after the last piece.
struct AudioLost {
  archive::GapCause cause = archive::GapCause::kSignalLost;
};
using QueueItem = std::variant<QueuedFrame, QueuedAudio, SourceLost, AudioLost>;

/// One producer of pictures, one of audio, one consumer. Thread-safe.
class FrameQueue {
 public:
  /// `budget_bytes` of pictures may wait.
  explicit FrameQueue(std::size_t budget_bytes) : budget_bytes_(budget_bytes) {}

  /// Adds a picture or audio if there is room. Without room: waits if `patient` (a source that states its own
  /// times loses nothing by waiting), else drops it, counts it, and states it with the next frame that fits.
  /// Where holes come fast, they grow longer and so fewer: what has been waiting is coded first, and beyond
  /// GapPace the hole lasts until another one may be stated. Returns whether the frame was taken.
  bool push(TimedFrame frame, bool patient);
  void push(SourceLost lost);
  void push(AudioLost lost);
  /// Nothing more comes.
  void finish();
  /// The next item; nothing when finished and empty.
  std::optional<QueueItem> pop();
  /// Makes a patient push() return and everything after it be dropped unstated: the consumer failed.
  void abandon();

  /// Frames dropped so far, those that the source lost included.
  [[nodiscard]] std::uint64_t dropped() const;
  /// Frames dropped after the last one that was taken, and since when; `frame` is empty. Nothing if none.
  [[nodiscard]] std::optional<QueuedFrame> unstated_drops();

 private:
  /// Whether a picture for which there is room is dropped like those before it.
  bool prolongs_hole(std::int64_t time_ns);

  const std::size_t budget_bytes_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<QueueItem> items_;
  std::size_t waiting_bytes_ = 0;
  bool finished_ = false;
  bool abandoned_ = false;
  std::uint64_t dropped_ = 0;
  std::uint64_t dropped_before_next_ = 0;
  std::int64_t first_dropped_ns_ = 0;
  archive::GapCause dropped_cause_ = archive::GapCause::kOverload;
  std::int64_t last_taken_ns_ = 0;
  GapPace gaps_;
  LossPace losses_;
  bool empties_ = false;  // no picture is taken before all that wait are coded
};

/// One sample of sound takes a frame, its buffers and a place in the queue, too.
inline constexpr std::size_t kLeastFrameBytes = 1024;
/// Memory that the picture or audio occupies.
std::size_t frame_bytes(const AVFrame& frame);

}  // namespace kiroku::recorder

// Pictures for whoever looks on while they are recorded. The recorder offers each one and never waits; of
// what is not taken in time only the newest is kept. Thread-safe.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>

#include "media/libav_handles.h"
#include "recorder/source/source.h"

namespace kiroku::recorder {

class PictureTap {
 public:
  /// The picture belongs to others, too, and must not be changed.
  struct Picture {
    media::Frame frame;
    std::int64_t time_ns = 0;  // case clock
    Rational rate{25, 1};      // nominal, of its source
  };

  /// By a capture thread. Costs next to nothing while nobody watches; never waits, whatever a watcher does.
  void offer(const TimedFrame& picture) noexcept;

  /// Whether pictures are wanted at all.
  void watch(bool wanted);
  /// The newest picture that was not taken yet, by one watcher's thread; nothing if none came within
  /// `patience`.
  std::optional<Picture> take(std::chrono::milliseconds patience);

  /// Pictures that were offered while somebody watched, and those of them that nobody took.
  [[nodiscard]] std::uint64_t offered() const { return offered_; }
  [[nodiscard]] std::uint64_t passed_over() const { return passed_over_; }

 private:
  std::atomic<bool> wanted_ = false;
  std::atomic<std::uint64_t> offered_ = 0, passed_over_ = 0;
  std::mutex mutex_;  // held for the time of an exchange alone
  std::condition_variable changed_;
  std::optional<Picture> newest_;
};

}  // namespace kiroku::recorder

// Work that nobody waits for yet, done beside what somebody waits for. Thread-safe.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace kiroku::playback {

/// One thread of low priority, begun with the first task. The newest tasks come first, and old ones that were
/// not begun are forgotten: what was wanted next before somebody sought elsewhere is wanted no more.
class ReadAhead {
 public:
  ReadAhead() = default;
  /// Waits for the task that runs.
  ~ReadAhead();
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;

  /// Errors of the task are dropped: who asks for the same later meets them himself.
  void add(std::function<void()> task);

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> tasks_;  // the newest in front
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace kiroku::playback

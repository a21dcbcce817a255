// Fetching what will be read next, beside what is read now. Thread-safe.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace kiroku::fleet {

/// A few threads, begun when they are needed first. Tasks are begun in their order; of too many that wait the
/// oldest are forgotten, as whoever needs what they were to fetch fetches it himself.
class FetchingAhead {
 public:
  static constexpr std::size_t kThreads = 4, kMostWaiting = 32;

  FetchingAhead() = default;
  /// Forgets what waits, and waits for what runs.
  ~FetchingAhead();
  FetchingAhead(const FetchingAhead&) = delete;
  FetchingAhead& operator=(const FetchingAhead&) = delete;

  /// Errors of the task are dropped: who asks for the same later meets them himself. It may add others, and
  /// must not wait for them.
  void add(std::function<void()> task);

 private:
  void run();

  std::mutex mutex_;  // guards the rest, but for the threads' ends
  std::condition_variable changed_;
  std::deque<std::function<void()>> waiting_;
  std::size_t idle_ = 0;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace kiroku::fleet

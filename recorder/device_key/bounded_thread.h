// A thread that asks hardware: whoever waits for it waits a bounded time, also where the hardware hangs. All
// that ask one piece of hardware share one. Thread-safe.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

namespace kiroku::recorder {

class BoundedThread {
 public:
  /// A TPM takes up to some hundreds of milliseconds.
  static constexpr std::chrono::milliseconds kLongestWait{3000};

  explicit BoundedThread(std::chrono::milliseconds longest_wait = kLongestWait);
  ~BoundedThread();
  BoundedThread(const BoundedThread&) = delete;
  BoundedThread& operator=(const BoundedThread&) = delete;
  /// Runs `work` on the thread, which starts with the first. Waits for its turn and for the work no longer
  /// than the longest wait together; while earlier work is unfinished it says so at once. Why the work is not
  /// done, one sentence; empty if it is. It must not throw, and may run on when nobody waits any more, also
  /// after this object is gone: it owns what it uses.
  [[nodiscard]] std::string run(std::function<void()> work);

 private:
  struct Shared;
  static void serve(const std::shared_ptr<Shared>& shared);

  std::chrono::milliseconds longest_wait_;
  std::shared_ptr<Shared> shared_;
  std::timed_mutex turn_;
  std::thread worker_;
};

}  // namespace kiroku::recorder

// Threads of their own for what costs much (hashing a password takes 128 MiB and a third of a second), so
// that nothing else waits behind it. Thread-safe.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace kiroku::viewer {

class CostlyWork {
 public:
  struct Limits {
    std::size_t threads = 2;
    /// Of each of the two queues: one more is refused at once.
    std::size_t waiting = 16;
    /// Waiting or being done of one who asks.
    std::size_t of_one = 2;
    /// Of those being done at a time, so that one alone never keeps every thread.
    std::size_t done_of_one = 1;
  };
  explicit CostlyWork(const Limits& limits);
  /// As stop().
  ~CostlyWork();
  CostlyWork(const CostlyWork&) = delete;
  CostlyWork& operator=(const CostlyWork&) = delete;

  /// False, without doing anything, where as many wait as may, or as many of `who`. `work` is called once on
  /// one of the threads and must not throw. What `goes_first` is done before all that does not, and whatever
  /// comes after it before a second one of somebody of whom one is being done.
  bool offer(bool goes_first, const std::string& who, std::function<void()> work);
  /// Ends what is being done and drops what waits, which is never called then.
  void stop();

 private:
  struct Item {
    std::string who;
    std::function<void()> work;
  };
  struct Count {
    std::size_t all = 0, being_done = 0;
  };
  /// The next that may be done; with the mutex held.
  bool take_next(Item& next);
  void run();
  const Limits limits_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Item> first_, others_;
  std::map<std::string, Count> of_one_;
  bool is_stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace kiroku::viewer

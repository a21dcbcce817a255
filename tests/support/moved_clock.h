// A clock that stands until a test moves it.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <list>
#include <mutex>
#include <thread>

#include "base/clock.h"

namespace kiroku::test {

/// Thread-safe; must outlive whoever waits by it.
class MovedClock final : public Clock {
 public:
  explicit MovedClock(UtcTime utc = UtcTime(std::chrono::seconds(1'785'920'400))) : utc_(utc) {}

  [[nodiscard]] Time now() const override {
    const std::lock_guard guard(mutex_);
    return now_;
  }
  [[nodiscard]] UtcTime utc() const override {
    const std::lock_guard guard(mutex_);
    return utc_;
  }
  [[nodiscard]] Duration since_boot() const override {
    const std::lock_guard guard(mutex_);
    return now_.time_since_epoch() + suspended_;
  }
  using Clock::wait_until;
  void wait_until(std::condition_variable& changed, std::unique_lock<std::mutex>& lock,
                  Time deadline) const override {
    const auto self = [&] {
      const std::lock_guard guard(mutex_);
      waiting_.push_back({&changed, deadline});
      waits_.notify_all();
      return std::prev(waiting_.end());
    }();
    // Nothing is missed between here and the wait: move() notifies until nobody whose time has come is left.
    if (now() < deadline) changed.wait(lock);
    const std::lock_guard guard(mutex_);
    waiting_.erase(self);
    waits_.notify_all();
  }

  /// Both kinds of time go on. Returns when every wait whose deadline has come is over.
  void move(Duration by) {
    std::unique_lock lock(mutex_);
    now_ += by;
    utc_ += std::chrono::floor<UtcTime::duration>(by);
    const auto is_due = [this](const Waiting& each) { return each.deadline <= now_; };
    while (std::ranges::any_of(waiting_, is_due)) {
      for (const Waiting& each : waiting_) {
        if (is_due(each)) each.changed->notify_all();
      }
      lock.unlock();
      std::this_thread::yield();
      lock.lock();
    }
  }
  /// The machine sleeps: no wait ends.
  void suspend(Duration by) {
    const std::lock_guard guard(mutex_);
    suspended_ += by;
    utc_ += std::chrono::floor<UtcTime::duration>(by);
  }
  /// Somebody sets the wall clock.
  void set_utc(UtcTime utc) {
    const std::lock_guard guard(mutex_);
    utc_ = utc;
  }
  /// How many threads wait for a later time.
  [[nodiscard]] std::size_t waiting() const {
    const std::lock_guard guard(mutex_);
    return static_cast<std::size_t>(
        std::ranges::count_if(waiting_, [this](const Waiting& each) { return each.deadline > now_; }));
  }
  /// Returns once so many threads wait for a later time.
  void await_waiting(std::size_t threads) const {
    std::unique_lock lock(mutex_);
    waits_.wait(lock, [&] {
      return std::ranges::count_if(waiting_, [this](const Waiting& each) { return each.deadline > now_; }) >=
             static_cast<std::ptrdiff_t>(threads);
    });
  }

 private:
  struct Waiting {
    std::condition_variable* changed;
    Time deadline;
  };
  mutable std::mutex mutex_;  // of what follows
  mutable std::condition_variable waits_;
  mutable std::list<Waiting> waiting_;
  Time now_ = Time(std::chrono::hours(1));
  Duration suspended_{0};
  UtcTime utc_;
};

}  // namespace kiroku::test

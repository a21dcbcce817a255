#include "fleet/fetching_ahead.h"

#include <exception>
#include <utility>

namespace kiroku::fleet {

FetchingAhead::~FetchingAhead() {
  {
    const std::lock_guard guard(mutex_);
    stopping_ = true;
    waiting_.clear();
  }
  changed_.notify_all();
  for (std::thread& each : threads_) each.join();
}

void FetchingAhead::add(std::function<void()> task) {
  {
    const std::lock_guard guard(mutex_);
    if (stopping_) return;
    waiting_.push_back(std::move(task));
    if (waiting_.size() > kMostWaiting) waiting_.pop_front();
    if (waiting_.size() > idle_ && threads_.size() < kThreads) threads_.emplace_back([this] { run(); });
  }
  changed_.notify_one();
}

void FetchingAhead::run() {
  std::unique_lock guard(mutex_);
  for (;;) {
    ++idle_;
    changed_.wait(guard, [this] { return stopping_ || !waiting_.empty(); });
    --idle_;
    if (stopping_) return;
    const std::function<void()> task = std::move(waiting_.front());
    waiting_.pop_front();
    guard.unlock();
    try {
      task();
    } catch (const std::exception&) {
      // told to whoever asks for it
    }
    guard.lock();
  }
}

}  // namespace kiroku::fleet

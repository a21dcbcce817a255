// One computation for all who want the same at the same time. Thread-safe.
#pragma once

#include <exception>
#include <functional>
#include <future>
#include <map>
#include <mutex>
#include <string>

namespace kiroku::playback {

template <typename Value>
class SingleFlight {
 public:
  /// What `compute` gives, or throws; where another thread computes the same already, what that one comes to.
  Value get(const std::string& name, const std::function<Value()>& compute) {
    std::promise<Value> promise;
    {
      std::unique_lock guard(mutex_);
      const auto running = running_.find(name);
      if (running != running_.end()) {
        const std::shared_future<Value> result = running->second;
        guard.unlock();
        return result.get();
      }
      running_.emplace(name, promise.get_future().share());
    }
    try {
      Value value = compute();
      finish(name);
      promise.set_value(value);
      return value;
    } catch (...) {
      finish(name);
      promise.set_exception(std::current_exception());
      throw;
    }
  }

 private:
  void finish(const std::string& name) {
    const std::lock_guard guard(mutex_);
    running_.erase(name);
  }

  std::mutex mutex_;
  std::map<std::string, std::shared_future<Value>> running_;
};

}  // namespace kiroku::playback

// Connections to one store, for several threads. Thread-safe.
#pragma once

#include <functional>
#include <mutex>
#include <vector>

#include "fleet/object_store.h"

namespace kiroku::fleet {

class StoreConnections {
 public:
  explicit StoreConnections(std::function<ObjectStore()> connect) : connect_(std::move(connect)) {}

  /// Calls `work` with a connection of its own, and keeps that for the next one unless `work` throws.
  template <typename Work>
  auto with(const Work& work) {
    ObjectStore store = take();
    if constexpr (std::is_void_v<decltype(work(store))>) {
      work(store);
      give_back(std::move(store));
    } else {
      auto result = work(store);
      give_back(std::move(store));
      return result;
    }
  }

 private:
  ObjectStore take() {
    {
      const std::lock_guard guard(mutex_);
      if (!idle_.empty()) {
        ObjectStore store = std::move(idle_.back());
        idle_.pop_back();
        return store;
      }
    }
    return connect_();
  }
  void give_back(ObjectStore store) {
    constexpr std::size_t kMostIdle = 16;
    const std::lock_guard guard(mutex_);
    if (idle_.size() < kMostIdle) idle_.push_back(std::move(store));
  }

  const std::function<ObjectStore()> connect_;
  std::mutex mutex_;
  std::vector<ObjectStore> idle_;
};

}  // namespace kiroku::fleet

// How many requests each of those who showed a certificate may make in a while, whatever they ask for, so
// that one of them cannot keep a server from the others. Thread-safe.
#pragma once

#include <cstddef>
#include <mutex>
#include <string>
#include <unordered_map>

#include "base/clock.h"

namespace kiroku::fleet {

class RequestBudget {
 public:
  /// `most` in each `window`, of at most `names` who ask. `clock` must outlive it.
  RequestBudget(std::size_t most, Clock::Duration window, std::size_t names,
                const Clock& clock = Clock::system());
  /// Whether one more may be answered.
  bool take(const std::string& who);

 private:
  const std::size_t most_, names_;
  const Clock::Duration window_;
  const Clock& clock_;
  std::mutex mutex_;  // of what follows
  Clock::Time ends_;
  std::unordered_map<std::string, std::size_t> taken_;
};

}  // namespace kiroku::fleet

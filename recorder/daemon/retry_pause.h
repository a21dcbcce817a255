// How long a room waits before it tries again what failed. Not thread-safe.
#pragma once

#include <string>

#include "base/clock.h"

namespace kiroku::recorder {

/// A second after the first failure, twice as long after each further one, a minute at most.
class RetryPause {
 public:
  void failed(Clock::Time now);
  void succeeded() { *this = {}; }
  [[nodiscard]] bool may_try(Clock::Time now) const { return now >= not_before_; }
  /// To be added to what went wrong: "; the next try is in 4 s".
  [[nodiscard]] std::string next_try() const;

 private:
  Clock::Duration pause_{};
  Clock::Time not_before_{};
};

}  // namespace kiroku::recorder

// How fast one person's deeds may follow each other where each leaves something for good: an entry of the
// appliance log, which is signed and flushed. Thread-safe. Kept in memory alone.
#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <mutex>
#include <string>

#include "base/clock.h"

namespace kiroku::viewer {

class DeedPace {
 public:
  struct Limits {
    std::size_t at_once = 120;            // of a person who did nothing for long
    std::chrono::milliseconds each{500};  // after which one more may follow
  };
  DeedPace() : DeedPace(Limits()) {}
  explicit DeedPace(const Limits& limits) : limits_(limits) {}

  /// Zero: the deed counts, and may be done. Else how long `person` (Session::person()) has to wait; then it
  /// does not count.
  [[nodiscard]] std::chrono::seconds take(const std::string& person, Clock::Time now);

 private:
  const Limits limits_;
  std::mutex mutex_;
  /// When all that somebody did is forgotten; nobody stands here for longer.
  std::map<std::string, Clock::Time> forgotten_;
};

}  // namespace kiroku::viewer

// When a room records by itself: weekly windows in the machine's local time, "mon-fri 07:30-16:00". Being
// inside a window is what counts, not the moment it begins, so that a machine that starts late, or whose
// clock jumps over the beginning (daylight saving), still records. Immutable values, thread-safe.
#pragma once

#include <bitset>
#include <ctime>
#include <string>
#include <string_view>
#include <vector>

#include "base/utc_time.h"

namespace kiroku::recorder {

class Schedule {
 public:
  Schedule() = default;
  /// Each text is DAYS HH:MM-HH:MM; DAYS is "daily", or days and ranges of them with commas ("mon-wed,fri").
  /// A window whose end is not after its beginning ends on the day after. Throws kiroku::UsageError.
  static Schedule parse(const std::vector<std::string>& windows);
  [[nodiscard]] bool empty() const { return windows_.empty(); }
  /// Whether a window holds the local time; its first minute belongs to it, its last one does not.
  [[nodiscard]] bool contains(const std::tm& local) const;

 private:
  struct Window {
    std::bitset<7> days;  // as tm_wday: Sunday is 0
    int begin_minute = 0, end_minute = 0;
  };
  static Window parse_window(std::string_view text);
  std::vector<Window> windows_;
};

/// As this machine's clocks on the wall show it.
std::tm local_time(UtcTime at);

}  // namespace kiroku::recorder

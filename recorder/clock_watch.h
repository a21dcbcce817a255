// The state of the machine's wall clock, for `clock` entries. One thread.
#pragma once

#include <cstdint>
#include <optional>

#include "archive/ledger_entry.h"
#include "recorder/case_clock.h"

namespace kiroku::recorder {

class ClockWatch {
 public:
  explicit ClockWatch(const CaseClock& clock);
  /// An entry when one is due: the first time, each minute, and when the wall clock stepped by more than a
  /// tenth of a second against the monotonic one since the last call. Call about each second.
  std::optional<archive::ClockEntry> check();

 private:
  [[nodiscard]] std::int64_t wall_minus_case_ns() const;

  const CaseClock& clock_;
  std::int64_t last_difference_ns_;
  std::optional<std::int64_t> last_entry_ns_;
};

}  // namespace kiroku::recorder

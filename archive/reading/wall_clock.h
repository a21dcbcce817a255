// The machine's wall clock beside the case clock, as the ledger states both: the opening's time, and each
// time that the wall clock was set since (docs/reference/format.md, "Clocks"). Immutable; thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "archive/format/ledger_entry.h"
#include "base/utc_time.h"

namespace kiroku::archive {

class WallClock {
 public:
  /// Seen within a second: that much before `mono_ns` the clock may have been set already.
  struct Step {
    std::int64_t mono_ns = 0, step_ns = 0;
  };
  WallClock() = default;
  WallClock(const Moment& opened, std::vector<Step> steps);

  /// What the clock showed. Times that nanoseconds cannot count are as good as ones of 146 years away.
  [[nodiscard]] UtcTime at(std::int64_t case_ns) const;
  /// When it showed `utc`, in order: never or several times where it was set.
  [[nodiscard]] std::vector<std::int64_t> case_times(UtcTime utc) const;
  /// By the case clock; without those of 0.
  [[nodiscard]] const std::vector<Step>& steps() const { return steps_; }
  /// The step by which the clock passed over `utc`, which it never showed; null where there is none.
  [[nodiscard]] const Step* step_over(UtcTime utc) const;
  /// What it showed just before and just behind a step, which is one of steps().
  [[nodiscard]] std::pair<UtcTime, UtcTime> around(const Step& step) const;

 private:
  [[nodiscard]] UtcTime shown(std::int64_t case_ns, std::size_t steps_before) const;

  Moment opened_;
  std::vector<Step> steps_;
  std::vector<std::int64_t> offsets_us_{0};  // by the first i steps, all together
};

}  // namespace kiroku::archive

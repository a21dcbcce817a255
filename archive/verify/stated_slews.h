// By how much the slews that a ledger states may have moved its case clock (docs/reference/format.md,
// "Clocks"). Times are of the case clock, in ns. Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace kiroku::archive {

class StatedSlews {
 public:
  /// No kernel makes a clock run faster or slower than by this, and no statement excuses more. Linux: a tick
  /// of 9,000 to 11,000 us and 500 ppm beside it (adjtimex(2)).
  static constexpr std::int64_t kFastestPpb = 100'500'000;

  /// The rate of a clock entry that was written at `mono_ns`; entries in the ledger's order.
  void add(std::int64_t rate_ppb, std::int64_t mono_ns);
  /// A recording that was cut off: what was stated before holds until then and no longer.
  void cut_off(std::int64_t mono_ns);
  /// All in all up to this time, either way. What an entry states changes what was returned of times since
  /// the entry before it: ask when all are added. O(log entries).
  [[nodiscard]] std::int64_t until(std::int64_t mono_ns) const;

 private:
  /// From one entry to the next.
  struct Stretch {
    std::int64_t from_ns = 0;
    std::int64_t moved_ns = 0;  // before it
    std::int64_t rate_ppb = 0;  // in it
  };
  void begin_stretch(std::int64_t from_ns, std::int64_t rate_ppb);

  std::vector<Stretch> stretches_{{}};
  std::int64_t stated_ppb_ = 0;  // by the latest entry; 0 unless it is a slew
};

}  // namespace kiroku::archive

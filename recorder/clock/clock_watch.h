// The state of the machine's clocks, for `clock` entries. One thread.
//
// A step changes CLOCK_REALTIME against CLOCK_BOOTTIME, at once. A slew changes the rate of both, and so of
// the case clock, against CLOCK_MONOTONIC_RAW, which nobody corrects; a synchronised machine always has some
// such rate, since it corrects its crystal.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>

#include "archive/format/ledger_entry.h"
#include "recorder/clock/case_clock.h"

namespace kiroku::recorder {

/// All clocks at one instant.
struct ClockReading {
  std::int64_t case_ns = 0;         // CLOCK_BOOTTIME since open
  std::int64_t wall_ns = 0;         // CLOCK_REALTIME since 1970
  std::int64_t raw_ns = 0;          // CLOCK_MONOTONIC_RAW, and the time that the machine slept
  std::int64_t uncertainty_ns = 0;  // how far apart the three instants may be
};
/// Read several times where the thread was interrupted in between; the closest ones count.
ClockReading read_clocks(const CaseClock& clock);

/// What the kernel says of its synchronisation (adjtimex, RFC 5905 appendix): nothing is changed.
struct KernelClock {
  bool synchronised = false;
  std::int64_t offset_ns = 0, error_ns = 0;
};
KernelClock read_kernel_clock();

class ClockWatch {
 public:
  struct Clocks {
    std::function<ClockReading()> read;
    std::function<KernelClock()> kernel;
  };
  /// The smallest step that is stated: a quarter of a picture's time, and a hundred times what a reading on a
  /// busy machine is uncertain. Smaller ones are stated once together they are larger.
  static constexpr std::int64_t kSmallestStepNs = 10'000'000;
  /// A slew is seen over this time and a fifth of a second between two calls, so within a second.
  static constexpr std::int64_t kWindowNs = 800'000'000;

  explicit ClockWatch(const CaseClock& clock);
  explicit ClockWatch(Clocks clocks);
  /// An entry when one is due: the first time, each minute, when the wall clock stepped since the last entry,
  /// and when a slew (archive::kSlewPpb) began or ended. Call five times a second; a step is seen by the next
  /// call.
  std::optional<archive::ClockEntry> check();

 private:
  /// Whether a slew began or ended, by the window that ends now.
  bool slew_changed(const ClockReading& now);
  archive::ClockEntry entry(const ClockReading& now, std::int64_t step_ns, const ClockReading& rate_since);

  Clocks clocks_;
  std::deque<ClockReading> window_;     // oldest first: one at least kWindowNs old, where there is one
  std::optional<ClockReading> stated_;  // at the latest entry
  bool slewing_ = false;
};

}  // namespace kiroku::recorder

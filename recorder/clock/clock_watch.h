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

  /// A clock whose rate changes all the time gets so many entries at once and then one in this time.
  static constexpr std::int64_t kMostSlewsAtOnce = 10;
  static constexpr std::int64_t kSlewEveryNs = 3'000'000'000;

  explicit ClockWatch(const CaseClock& clock);
  explicit ClockWatch(Clocks clocks);
  /// An entry when one is due: the first time, each minute, when the wall clock stepped since the last entry,
  /// when a slew (archive::kSlewPpb) began or ended, when one is first known from a window that lies wholly
  /// within it, and when its rate over such a window differs by more than a fifth from the latest that was
  /// stated. Call five times a second; a step is seen by the next call.
  std::optional<archive::ClockEntry> check();

 private:
  /// Whether there is a slew, by the window that ends now.
  void look(const ClockReading& now);
  /// Whether the latest entry leaves a reader with another slew than there is.
  [[nodiscard]] bool slew_is_news(const ClockReading& now) const;
  bool may_state_slew(const ClockReading& now);
  archive::ClockEntry entry(const ClockReading& now, std::int64_t step_ns, const ClockReading& rate_since);

  Clocks clocks_;
  std::deque<ClockReading> window_;     // oldest first: one at least kWindowNs old, where there is one
  std::optional<ClockReading> stated_;  // at the latest entry
  bool slewing_ = false;
  // at the latest entry
  bool stated_slewing_ = false;
  bool stated_beginning_ = false;  // over a window that the slew may have begun in
  std::int64_t stated_ppb_ = 0;
  // raw_ns; kSlewEveryNs on for each that was stated
  std::int64_t slews_paid_until_ns_ = -kMostSlewsAtOnce * kSlewEveryNs;
};

}  // namespace kiroku::recorder

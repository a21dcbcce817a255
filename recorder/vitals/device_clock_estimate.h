// How a device's own clock stands to the case clock, from the times it writes into what arrives. A value-like
// object; one thread.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "media/vital_line.h"

namespace kiroku::recorder {

/// A message stamped `d` by the device and arriving at `a` was at least no time on its way, so the device's
/// clock showed at least d - a when the case clock was zero; delays, and stamps cut to whole seconds, only
/// make it less. The estimate is therefore the greatest d - a of the last kWindow messages, and its spread
/// how far the middle one lies below (a minimum filter of the delay).
class DeviceClockEstimate {
 public:
  static constexpr std::size_t kWindow = 64;
  /// So many messages in a row, over so long a time, that disagree with the estimate by more than kStepUs and
  /// agree among themselves, mean that the clock was set. What was only held up on its way arrives at once.
  static constexpr std::size_t kStepMessages = 5;
  static constexpr std::int64_t kStepSpanNs = 3'000'000'000;
  static constexpr std::int64_t kStepUs = 2'000'000;

  /// Microseconds by which the device's clock was set, if this message shows that it was; else nothing.
  std::optional<std::int64_t> add(std::int64_t arrival_ns, UtcTime device_time);
  /// What is known after the first add(). `source` is left empty.
  [[nodiscard]] media::DeviceClock estimate() const;

 private:
  [[nodiscard]] std::int64_t greatest() const;

  struct Outlier {
    std::int64_t zero_us = 0, arrival_ns = 0;
  };
  [[nodiscard]] bool shows_step() const;

  std::deque<std::int64_t> zeros_us_;  // d - a, oldest first
  std::deque<Outlier> outliers_;       // the last ones, as long as all disagree the same way
  std::int64_t last_arrival_ns_ = 0;
  std::uint64_t messages_ = 0;  // since the clock was last set
};

}  // namespace kiroku::recorder

// By which time zone times count that state none. Immutable; thread-safe.
#pragma once

#include <chrono>
#include <optional>

#include "base/utc_time.h"

namespace kiroku::recorder {

class AssumedZone {
 public:
  /// Always so far from UTC.
  AssumedZone(std::chrono::minutes fixed) : fixed_(fixed) {}  // NOLINT(google-explicit-constructor)
  /// This machine's: by its rules for the moment that is meant, never by today's offset. What is planned for
  /// after a change of clocks is planned by the clocks of then.
  static AssumedZone local() { return {}; }

  /// How far a clock that shows `local` (as if it were UTC) is from UTC. Where clocks went back and showed it
  /// twice, it is the time nearer to `near` (absent: to now); a time that they left out counts as before the
  /// change.
  [[nodiscard]] std::chrono::seconds at(UtcTime local, std::optional<UtcTime> near = {}) const;
  [[nodiscard]] UtcTime utc(UtcTime local, std::optional<UtcTime> near = {}) const {
    return local - at(local, near);
  }

 private:
  AssumedZone() = default;

  std::optional<std::chrono::minutes> fixed_;  // absent: this machine's zone
};

}  // namespace kiroku::recorder

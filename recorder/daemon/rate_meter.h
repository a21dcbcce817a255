// How fast a room writes. Not thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>

#include "base/clock.h"

namespace kiroku::recorder {

/// Bytes a second over about the last minute.
class RateMeter {
 public:
  /// `bytes` in all had been written at `now`. Called more often than once a second, it keeps the first.
  void add(Clock::Time now, std::uint64_t bytes);
  /// 0 until two moments are known.
  [[nodiscard]] double bytes_per_second() const;

 private:
  static constexpr std::chrono::seconds kWindow{60};
  struct Sample {
    Clock::Time when;
    std::uint64_t bytes;
  };
  std::deque<Sample> samples_;
};

}  // namespace kiroku::recorder

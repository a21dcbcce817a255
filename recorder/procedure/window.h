// How near two times are that hospitals state: also of "no end", which is further than nanoseconds can count.
#pragma once

#include <chrono>

#include "base/utc_time.h"

namespace kiroku::recorder {

inline bool is_within(UtcTime::duration distance, std::chrono::nanoseconds window) {
  return distance <= std::chrono::duration_cast<UtcTime::duration>(window);
}
inline bool is_within(UtcTime one, UtcTime other, std::chrono::nanoseconds window) {
  return is_within(std::chrono::abs(one - other), window);
}

}  // namespace kiroku::recorder

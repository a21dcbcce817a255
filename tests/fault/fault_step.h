// How many of the possible points a test of faults tries.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <string>

namespace kiroku::test {

/// Every so many: KIROKU_FAULT_EVERY (1: each), else `usual`.
inline std::size_t fault_step(std::size_t usual) {
  const char* const asked = std::getenv("KIROKU_FAULT_EVERY");
  return asked == nullptr ? usual : std::max<std::size_t>(1, std::stoul(asked));
}

}  // namespace kiroku::test

// How many of the possible points a test of faults tries.
#pragma once

#include <algorithm>

#include "tests/support/asked_number.h"

namespace kiroku::test {

/// Every so many: KIROKU_FAULT_EVERY (1: each), else `usual`.
inline std::size_t fault_step(std::size_t usual) {
  return std::max<std::size_t>(1, asked_number("KIROKU_FAULT_EVERY", usual));
}

}  // namespace kiroku::test

// A sum of counts that somebody else stated, which can pass the largest number: then it is that one, and not
// some small one. Pure function.
#pragma once

#include <cstdint>

namespace kiroku {

constexpr std::uint64_t saturated_sum(std::uint64_t a, std::uint64_t b) {
  return b > UINT64_MAX - a ? UINT64_MAX : a + b;
}

}  // namespace kiroku

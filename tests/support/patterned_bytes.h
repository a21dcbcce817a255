// Bytes that differ everywhere and are the same each time.
#pragma once

#include <cstdint>

#include "base/bytes.h"

namespace kiroku::test {

/// Not random, but without any repetition that a chunked format could hide behind (xorshift64*).
inline Bytes patterned_bytes(std::size_t size, std::uint64_t seed = 0x9e3779b97f4a7c15) {
  Bytes bytes(size);
  std::uint64_t state = seed;
  for (auto& byte : bytes) {
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    byte = static_cast<std::byte>(state * 0x2545f4914f6cdd1d >> 56);
  }
  return bytes;
}

}  // namespace kiroku::test

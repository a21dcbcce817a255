// Times as entries hold them: nanoseconds.
#pragma once

#include <cstdint>

namespace kiroku {

inline constexpr std::int64_t kMs = 1'000'000;
inline constexpr std::int64_t kSecond = 1'000 * kMs;

}  // namespace kiroku

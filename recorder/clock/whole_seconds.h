// How long something takes, as sentences of the recorder say it.
#pragma once

#include <chrono>
#include <string>

namespace kiroku::recorder {

/// "3 s", rounded up.
inline std::string whole_seconds(std::chrono::nanoseconds time) {
  return std::to_string(std::chrono::ceil<std::chrono::seconds>(time).count()) + " s";
}

}  // namespace kiroku::recorder

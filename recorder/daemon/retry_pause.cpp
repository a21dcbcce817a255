#include "recorder/daemon/retry_pause.h"

#include <algorithm>
#include <chrono>

namespace kiroku::recorder {
namespace {

constexpr std::chrono::seconds kFirstPause{1};
constexpr std::chrono::seconds kLongestPause{60};

}  // namespace

void RetryPause::failed(Clock::Time now) {
  pause_ = std::clamp<Clock::Duration>(2 * pause_, kFirstPause, kLongestPause);
  not_before_ = now + pause_;
}

std::string RetryPause::next_try() const {
  return "; the next try is in " +
         std::to_string(std::chrono::duration_cast<std::chrono::seconds>(pause_).count()) + " s";
}

}  // namespace kiroku::recorder

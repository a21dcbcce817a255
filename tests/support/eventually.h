// Waiting for what another thread, or another program, does: the one place where a test may sleep
// (tests/lint/waits.py).
#pragma once

#include <algorithm>
#include <chrono>
#include <thread>

namespace kiroku::test {

/// Looks until `holds()`; whether it did. The time is no promise of what is tested: it only ends a test that
/// fails, however busy the machine is.
template <typename Condition>
[[nodiscard]] bool eventually(const Condition& holds,
                              std::chrono::steady_clock::duration give_up_after = std::chrono::seconds(60)) {
  const auto end = std::chrono::steady_clock::now() + give_up_after;
  // What is looked at may be a program that has to be started.
  constexpr std::chrono::milliseconds kLongestPause{50};
  for (std::chrono::milliseconds pause{1}; !holds(); pause = std::min(2 * pause, kLongestPause)) {
    if (std::chrono::steady_clock::now() > end) return holds();
    std::this_thread::sleep_for(pause);
  }
  return true;
}

}  // namespace kiroku::test

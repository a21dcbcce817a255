// Ending long work where it looks, so that it takes away what it began. Thread-safe.
#pragma once

#include <chrono>

namespace kiroku::apps {

/// From now on Ctrl-C and SIGTERM only make told_to_end() true, whichever thread they meet: some libraries
/// start threads (OpenBLAS) before a signal could be blocked in them. Who asks twice is obeyed at once.
/// Throws kiroku::Error.
void end_when_told();
[[nodiscard]] bool told_to_end();
/// Returns once it is told. After end_when_told().
void wait_until_told();
/// The same, or once `pause` is over; whether it is told.
bool wait_until_told(std::chrono::milliseconds pause);

}  // namespace kiroku::apps

// Ending long work where it looks, so that it takes away what it began. Thread-safe.
#pragma once

namespace kiroku::apps {

/// From now on Ctrl-C and SIGTERM only make told_to_end() true; who asks twice is obeyed at once.
void end_when_told();
[[nodiscard]] bool told_to_end();

}  // namespace kiroku::apps

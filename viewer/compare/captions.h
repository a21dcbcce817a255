// What stands around the pictures of a comparison at one moment. A pure function, thread-safe.
#pragma once

#include <cstdint>

#include "viewer/compare/comparison.h"
#include "viewer/compare/composition.h"

namespace kiroku::compare {

/// What is done at that moment, when that is on both clocks, and the newest vital signs. The comparison must
/// have a time map.
Caption caption_at(const Comparison& comparison, std::int64_t case_ns);

}  // namespace kiroku::compare

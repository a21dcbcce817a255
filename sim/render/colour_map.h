// Numbers as colours. Pure, thread-safe.
#pragma once

#include "sim/render/picture.h"

namespace kiroku::sim {

/// Viridis of S. van der Walt and N. Smith (CC0): equal steps of a number look equally large, its lightness
/// only grows, and colour-blind people can read it. `share` from 0 to 1; beyond, its ends.
Rgb viridis(double share);

}  // namespace kiroku::sim

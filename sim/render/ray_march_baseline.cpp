// Whatever the compiler is told to build for.
#include "sim/render/ray_march_lanes.h"

namespace kiroku::sim {

extern const MarchRays kMarchRaysBaseline;
const MarchRays kMarchRaysBaseline = &march_tile;

}  // namespace kiroku::sim

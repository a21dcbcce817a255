// AVX2. Without FMA: it would round otherwise than the others.
#if defined(__x86_64__)

#include "sim/render/ray_march_lanes.h"

namespace kiroku::sim {

extern const MarchRays kMarchRaysAvx2;
const MarchRays kMarchRaysAvx2 = &march_tile;

}  // namespace kiroku::sim

#endif

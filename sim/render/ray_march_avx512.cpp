// AVX-512. Without FMA: it would round otherwise than the others.
#if defined(__x86_64__)

#include "sim/render/ray_march_lanes.h"

namespace kiroku::sim {

extern const MarchRays kMarchRaysAvx512;
const MarchRays kMarchRaysAvx512 = &march_tile;

}  // namespace kiroku::sim

#endif

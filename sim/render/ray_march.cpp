#include "sim/render/ray_march.h"

namespace kiroku::sim {

extern const MarchRays kMarchRaysBaseline;

#if defined(__x86_64__)

extern const MarchRays kMarchRaysAvx2, kMarchRaysAvx512;

MarchRays march_rays(InstructionSet set) {
  if (!machine_has(set)) return nullptr;
  if (set == InstructionSet::kAvx512) return kMarchRaysAvx512;
  return set == InstructionSet::kAvx2 ? kMarchRaysAvx2 : kMarchRaysBaseline;
}

#else

MarchRays march_rays(InstructionSet set) {
  return set == InstructionSet::kBaseline ? kMarchRaysBaseline : nullptr;
}

#endif

}  // namespace kiroku::sim

#include "sim/drr/ray_kernel.h"

namespace kiroku::sim {

extern const ProjectCells kProjectCellsBaseline;

#if defined(__x86_64__)

extern const ProjectCells kProjectCellsAvx2, kProjectCellsAvx512;

ProjectCells ray_kernel(InstructionSet set) {
  if (!machine_has(set)) return nullptr;
  if (set == InstructionSet::kAvx512) return kProjectCellsAvx512;
  return set == InstructionSet::kAvx2 ? kProjectCellsAvx2 : kProjectCellsBaseline;
}

#else

ProjectCells ray_kernel(InstructionSet set) {
  return set == InstructionSet::kBaseline ? kProjectCellsBaseline : nullptr;
}

#endif

}  // namespace kiroku::sim

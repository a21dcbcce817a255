#include "sim/drr/ray_kernel.h"

#include <initializer_list>

namespace kiroku::sim {

extern const ProjectCells kProjectCellsBaseline;

#if defined(__x86_64__)

extern const ProjectCells kProjectCellsAvx2, kProjectCellsAvx512;

ProjectCells ray_kernel(InstructionSet set) {
  __builtin_cpu_init();
  if (set == InstructionSet::kAvx512) {
    const bool there = __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512bw") != 0 &&
                       __builtin_cpu_supports("avx512dq") != 0 && __builtin_cpu_supports("avx512vl") != 0;
    return there ? kProjectCellsAvx512 : nullptr;
  }
  if (set == InstructionSet::kAvx2) {
    const bool there = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
    return there ? kProjectCellsAvx2 : nullptr;
  }
  return kProjectCellsBaseline;
}

#else

ProjectCells ray_kernel(InstructionSet set) {
  return set == InstructionSet::kBaseline ? kProjectCellsBaseline : nullptr;
}

#endif

InstructionSet best_instruction_set() {
  for (const InstructionSet set : {InstructionSet::kAvx512, InstructionSet::kAvx2}) {
    if (ray_kernel(set) != nullptr) return set;
  }
  return InstructionSet::kBaseline;
}

}  // namespace kiroku::sim

#include "base/instruction_set.h"

#include <initializer_list>

namespace kiroku {

#if defined(__x86_64__)

bool machine_has(InstructionSet set) {
  __builtin_cpu_init();
  if (set == InstructionSet::kAvx512) {
    return __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512bw") != 0 &&
           __builtin_cpu_supports("avx512dq") != 0 && __builtin_cpu_supports("avx512vl") != 0;
  }
  if (set == InstructionSet::kAvx2)
    return __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
  return true;
}

#else

bool machine_has(InstructionSet set) { return set == InstructionSet::kBaseline; }

#endif

InstructionSet best_instruction_set() {
  for (const InstructionSet set : {InstructionSet::kAvx512, InstructionSet::kAvx2}) {
    if (machine_has(set)) return set;
  }
  return InstructionSet::kBaseline;
}

}  // namespace kiroku

#include "apps/kiroku/blas_kernels.h"

#include <cstdlib>

namespace kiroku::apps {

void ask_for_wide_blas_kernels() {
#ifdef __x86_64__
  __builtin_cpu_init();
  // What the kernels are compiled for.
  const bool has_avx2 = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
  const bool has_avx512 = __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512bw") != 0 &&
                          __builtin_cpu_supports("avx512cd") != 0 &&
                          __builtin_cpu_supports("avx512dq") != 0 && __builtin_cpu_supports("avx512vl") != 0;
  constexpr int kKeep = 0;
  if (has_avx2) ::setenv("OPENBLAS_CORETYPE", has_avx512 ? "SkylakeX" : "Haswell", kKeep);
#endif
}

}  // namespace kiroku::apps

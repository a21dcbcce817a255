#include "apps/kiroku/blas_kernels.h"

#include <cstdlib>

namespace kiroku::apps {

void ask_for_wide_blas_kernels() {
#ifdef __x86_64__
  __builtin_cpu_init();
  // What the kernels are compiled for.
  const bool has_all = __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512bw") != 0 &&
                       __builtin_cpu_supports("avx512cd") != 0 && __builtin_cpu_supports("avx512dq") != 0 &&
                       __builtin_cpu_supports("avx512vl") != 0;
  constexpr int kKeep = 0;
  if (__builtin_cpu_is("amd") != 0 && has_all) ::setenv("OPENBLAS_CORETYPE", "SkylakeX", kKeep);
#endif
}

}  // namespace kiroku::apps

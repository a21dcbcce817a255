// Which of its kernels the BLAS library is told to use.
#pragma once

namespace kiroku::apps {

/// OpenBLAS 0.3.21 chooses kernels by the processor's name: one that is newer than it gets those of SSE3
/// (seen on Emerald Rapids), one of AMD with AVX-512 those of AVX2. Sets OPENBLAS_CORETYPE to what the
/// processor has for programs that this one becomes, unless it is set; the library reads it when loaded.
/// Not thread-safe.
void ask_for_wide_blas_kernels();

}  // namespace kiroku::apps

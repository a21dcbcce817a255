// Which of its kernels the BLAS library is told to use.
#pragma once

namespace kiroku::apps {

/// OpenBLAS 0.3.21 gives processors of AMD that have AVX-512 the kernels of AVX2; later versions do not. Sets
/// OPENBLAS_CORETYPE for programs that this one becomes, unless it is set; the library reads it when loaded.
/// Not thread-safe.
void ask_for_wide_blas_kernels();

}  // namespace kiroku::apps

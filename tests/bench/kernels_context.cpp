// Says at the head of a benchmark which of its kernels OpenBLAS runs: OPENBLAS_CORETYPE of the shell decides,
// where it is set, and the same solve differs by a third between them.
#include <benchmark/benchmark.h>

extern "C" char*
openblas_get_corename();  // OpenBLAS declares it in cblas.h, which not every BLAS of Debian installs

namespace {
[[maybe_unused]] const bool told = [] {
  benchmark::AddCustomContext("OpenBLAS kernels", openblas_get_corename());
  return true;
}();
}  // namespace

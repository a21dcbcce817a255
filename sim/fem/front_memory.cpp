#include "sim/fem/front_memory.h"

#include <algorithm>
#include <new>
#include <sys/mman.h>

namespace kiroku::sim {

Numbers allocate_numbers(std::size_t count) {
  constexpr std::size_t kPage = 2U << 20;
  const bool large = count * sizeof(double) >= kPage / 2;
  const std::size_t alignment = large ? kPage : 64,
                    bytes = (std::max(count * sizeof(double), std::size_t{1}) + alignment - 1) / alignment *
                            alignment;
  Numbers numbers(static_cast<double*>(std::aligned_alloc(alignment, bytes)));
  if (!numbers) throw std::bad_alloc();
  if (large) ::madvise(numbers.get(), bytes, MADV_HUGEPAGE);
  return numbers;
}

}  // namespace kiroku::sim

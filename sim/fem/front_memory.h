// Memory of the fronts of a factorisation. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <memory>

namespace kiroku::sim {

struct Freed {
  void operator()(double* numbers) const { std::free(numbers); }
};
using Numbers = std::unique_ptr<double[], Freed>;

/// Uninitialised. Large ones are in huge pages where the kernel has any: several fronts are read at once,
/// more than the processor knows addresses of small pages by heart. Throws std::bad_alloc.
Numbers allocate_numbers(std::size_t count);

}  // namespace kiroku::sim

// Work in parts on several threads.
#pragma once

#include <cstddef>
#include <functional>

namespace kiroku {

/// do_part(0) to do_part(parts - 1), each once, on up to so many threads, this one among them; which part is
/// done by whom is left open, so that parts must not depend on each other. Returns when all are done; throws
/// what a part threw first, after which not all may have been done. Thread-safe.
void for_each_part(std::size_t parts, unsigned threads, const std::function<void(std::size_t)>& do_part);

}  // namespace kiroku

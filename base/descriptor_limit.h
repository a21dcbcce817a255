// How many files and connections a process may have open. Function; thread-safe, affects the whole process.
#pragma once

#include <cstdint>

namespace kiroku {

/// Raises the soft limit of descriptors to the hard one (setrlimit(2), RLIMIT_NOFILE) and returns what holds
/// then. A shell gives 1,024, for the sake of select(2), which knows no descriptor beyond FD_SETSIZE: only
/// for programs in which nothing calls select(). What they start must set its own limit.
std::uint64_t raise_descriptor_limit();

}  // namespace kiroku

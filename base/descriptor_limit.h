// How many files and connections a process may have open. Function; thread-safe, affects the whole process.
#pragma once

#include <cstdint>

namespace kiroku {

/// Raises the soft limit of descriptors to the hard one (setrlimit(2), RLIMIT_NOFILE) and returns what holds
/// then. A shell gives 1,024, for the sake of select(2), which knows no descriptor beyond FD_SETSIZE: only
/// for programs in which nothing calls select(). What they start must set its own limit.
std::uint64_t raise_descriptor_limit();

/// How many may be open now (the soft limit), and how many are (/proc/self/fd); 0 where that cannot be asked.
struct DescriptorCount {
  std::uint64_t may = 0, are = 0;
};
DescriptorCount count_descriptors();

/// So many of those that may be open are not for what others open by a network: files, sources and decoders
/// of a recording need them.
std::uint64_t descriptors_kept_back(std::uint64_t may);
/// Whether a connection that has this descriptor would take one of them: the kernel gives the lowest number
/// that is free (POSIX, "file descriptor allocation"), so a high one means that few are left. Then it must be
/// closed.
bool is_kept_back(int descriptor);

}  // namespace kiroku

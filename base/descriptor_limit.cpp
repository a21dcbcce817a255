#include "base/descriptor_limit.h"

#include <algorithm>
#include <filesystem>
#include <sys/resource.h>
#include <system_error>

namespace kiroku {

std::uint64_t raise_descriptor_limit() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) {
    return 0;
  }
  const rlim_t before = limit.rlim_cur;
  limit.rlim_cur = limit.rlim_max;
  return ::setrlimit(RLIMIT_NOFILE, &limit) == 0 ? limit.rlim_cur : before;
}

DescriptorCount count_descriptors() {
  DescriptorCount count;
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0) count.may = limit.rlim_cur;
  std::error_code failed;
  for (std::filesystem::directory_iterator each("/proc/self/fd", failed), end; !failed && each != end;
       each.increment(failed)) {
    ++count.are;
  }
  return count;
}

std::uint64_t descriptors_kept_back(std::uint64_t may) {
  constexpr std::uint64_t kMost = 256;
  return std::min(kMost, may / 4);
}

bool is_kept_back(int descriptor) {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return false;
  return static_cast<rlim_t>(descriptor) >= limit.rlim_cur - descriptors_kept_back(limit.rlim_cur);
}

}  // namespace kiroku

#include "apps/kirokud/descriptor_watch.h"

#include <cstdint>

#include <spdlog/spdlog.h>

#include "base/descriptor_limit.h"

namespace kiroku::apps {

void allow_many_descriptors() {
  constexpr std::uint64_t kEnough = 4096;
  if (const std::uint64_t may = raise_descriptor_limit(); may < kEnough)
    spdlog::warn(
        "only {} files and connections may be open at once: sources, segments and the viewer's guests "
        "share them; raise the hard limit to {} or more (LimitNOFILE= of the unit, `ulimit -Hn`)",
        may, kEnough);
}

void DescriptorWatch::look() {
  const DescriptorCount count = count_descriptors();
  const std::uint64_t kept = descriptors_kept_back(count.may);
  // What is told once is over when there are clearly more again.
  const bool few = count.are + (are_few_ ? 2 * kept : kept + kept / 4) >= count.may;
  if (few == are_few_) return;
  are_few_ = few;
  if (few) {
    spdlog::warn(
        "{} of {} files and connections are open: recording goes on, and further connections to the viewer "
        "and the hook are refused; raise the hard limit (LimitNOFILE= of the unit, `ulimit -Hn`)",
        count.are, count.may);
  } else {
    spdlog::info("{} of {} files and connections are open: connections are taken again", count.are,
                 count.may);
  }
}

}  // namespace kiroku::apps

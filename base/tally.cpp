#include "base/tally.h"

#include <bit>

namespace kiroku {

std::optional<std::uint64_t> Tally::add(const std::string& key) {
  const std::lock_guard guard(mutex_);
  ++total_;
  const bool has_room = counts_.size() < most_keys_ || counts_.contains(key);
  const std::uint64_t count = has_room ? ++counts_[key] : ++others_;
  return count <= told_each_ || std::has_single_bit(count) ? std::optional(count) : std::nullopt;
}

std::uint64_t Tally::total() const {
  const std::lock_guard guard(mutex_);
  return total_;
}

}  // namespace kiroku

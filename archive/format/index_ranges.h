// A set of numbers, given as ranges in any order: touching ones are joined, so that asking is a search. Not
// thread-safe.
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <map>

namespace kiroku::archive {

class IndexRanges {
 public:
  /// All from `first` to `last`, both among them; last ≥ first, and below 2^64 - 1.
  void add(std::uint64_t first, std::uint64_t last) {
    auto next = last_of_.upper_bound(first);
    if (next != last_of_.begin() && std::prev(next)->second + 1 >= first) {
      --next;
      first = next->first;
    }
    while (next != last_of_.end() && next->first <= last + 1) {
      last = std::max(last, next->second);
      next = last_of_.erase(next);
    }
    last_of_.emplace_hint(next, first, last);
  }
  [[nodiscard]] bool contains(std::uint64_t number) const {
    const auto next = last_of_.upper_bound(number);
    return next != last_of_.begin() && number <= std::prev(next)->second;
  }
  [[nodiscard]] std::size_t ranges() const { return last_of_.size(); }

 private:
  std::map<std::uint64_t, std::uint64_t> last_of_;  // by the first of each range
};

}  // namespace kiroku::archive

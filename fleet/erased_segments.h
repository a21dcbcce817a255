// Which segments of a case lines of its ledger say to be erased. Header-only; not thread-safe.
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "archive/format/ledger_entry.h"

namespace kiroku::fleet {

/// A ledger may have as many of these lines as of segments.
class ErasedSegments {
 public:
  void add(const archive::ErasedEntry& entry) {
    if (entry.first_index <= entry.last_index)
      streams_[entry.stream].emplace_back(entry.first_index, entry.last_index);
  }
  /// Before has() is asked.
  void join() {
    for (auto& [stream, ranges] : streams_) {
      std::ranges::sort(ranges);
      std::vector<Range> joined;
      for (const Range& each : ranges) {
        if (joined.empty() || each.first > joined.back().second) {
          joined.push_back(each);
        } else {
          joined.back().second = std::max(joined.back().second, each.second);
        }
      }
      ranges = std::move(joined);
    }
  }
  [[nodiscard]] bool has(const archive::SegmentEntry& segment) const {
    const auto ranges = streams_.find(segment.stream);
    if (ranges == streams_.end()) return false;
    const auto behind = std::ranges::upper_bound(ranges->second, segment.index, {}, &Range::first);
    return behind != ranges->second.begin() && segment.index <= std::prev(behind)->second;
  }

 private:
  using Range = std::pair<std::uint64_t, std::uint64_t>;  // the first and the last index
  std::map<std::string, std::vector<Range>> streams_;
};

}  // namespace kiroku::fleet

#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace kiroku::sim {

/// Many lists of one kind in one piece of memory, one after the other. A value; const functions are
/// thread-safe.
template <typename Item>
class Lists {
 public:
  explicit Lists(std::size_t lists) : begin_(lists + 1) {}
  /// First all are counted, then all are added.
  void count(std::size_t list) { ++begin_[list + 1]; }
  void allocate() {
    for (std::size_t list = 1; list < begin_.size(); ++list) begin_[list] += begin_[list - 1];
    items_.resize(begin_.back());
    next_.assign(begin_.begin(), begin_.end() - 1);
  }
  void add(std::size_t list, const Item& item) { items_[next_[list]++] = item; }
  [[nodiscard]] std::span<const Item> operator[](std::size_t list) const {
    return std::span(items_).subspan(begin_[list], begin_[list + 1] - begin_[list]);
  }

 private:
  std::vector<std::size_t> begin_, next_;
  std::vector<Item> items_;
};

}  // namespace kiroku::sim

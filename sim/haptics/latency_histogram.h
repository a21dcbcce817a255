// How times are spread, counted without memory to ask for. One thread adds, any reads meanwhile.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <cstdint>

namespace kiroku::sim {

/// Buckets are a sixteenth of their power of two wide: a percentile is at most 6.25 % above the true one.
class LatencyHistogram {
 public:
  void add(std::chrono::nanoseconds time) {
    const std::uint64_t value = time.count() > 0 ? static_cast<std::uint64_t>(time.count()) : 0;
    counts_[bucket_of(value)].fetch_add(1, std::memory_order_relaxed);
    if (value > longest_.load(std::memory_order_relaxed)) longest_.store(value, std::memory_order_relaxed);
  }

  /// The time that `share` (0 to 1) of all did not exceed; 0 if none was added.
  [[nodiscard]] std::chrono::nanoseconds percentile(double share) const {
    std::uint64_t all = 0, below = 0;
    for (const auto& count : counts_) all += count.load(std::memory_order_relaxed);
    if (all == 0) return std::chrono::nanoseconds(0);
    for (std::size_t bucket = 0; bucket < counts_.size(); ++bucket) {
      below += counts_[bucket].load(std::memory_order_relaxed);
      if (static_cast<double>(below) >= share * static_cast<double>(all))
        return std::min(std::chrono::nanoseconds(static_cast<std::int64_t>(end_of(bucket))), longest());
    }
    return longest();
  }
  [[nodiscard]] std::chrono::nanoseconds longest() const {
    return std::chrono::nanoseconds(static_cast<std::int64_t>(longest_.load(std::memory_order_relaxed)));
  }

 private:
  static constexpr std::size_t kParts = 16, kPartBits = 4;

  static std::size_t bucket_of(std::uint64_t value) {
    if (value < kParts) return static_cast<std::size_t>(value);
    const auto power = static_cast<std::size_t>(std::bit_width(value)) - kPartBits - 1;
    return kParts * power + static_cast<std::size_t>(value >> power);
  }
  static std::uint64_t end_of(std::size_t bucket) {
    if (bucket < kParts) return bucket;
    const std::size_t power = bucket / kParts - 1;
    return ((bucket % kParts + kParts + 1) << power) - 1;
  }

  std::array<std::atomic<std::uint64_t>, kParts*(64 - kPartBits + 1)> counts_{};
  std::atomic<std::uint64_t> longest_ = 0;
};

}  // namespace kiroku::sim

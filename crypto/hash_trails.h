// Remembers the trails of files that were hashed, so that who reads a file again and again does not hash the
// whole of it again and again. What is remembered is the hash, not the file: no inode and no time of change
// is believed, and every block that is read is hashed again (hashed_source.h). Thread-safe.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <mutex>

#include "crypto/hashed_source.h"

namespace kiroku::crypto {

class HashTrails {
 public:
  /// 64 GiB of files, whose trails take some 30 MiB.
  static constexpr std::size_t kMostBlocks = 128U << 10U;

  explicit HashTrails(std::size_t most_blocks = kMostBlocks) : most_blocks_(most_blocks) {}

  /// The trail that ends with this hash; null where none is remembered.
  [[nodiscard]] std::shared_ptr<const HashTrail> find(const Sha256Digest& sha256) const {
    const std::lock_guard guard(mutex_);
    const auto found = trails_.find(sha256);
    return found == trails_.end() ? nullptr : found->second;
  }
  /// The oldest ones are forgotten where there are too many.
  void add(const std::shared_ptr<const HashTrail>& trail) {
    const Sha256Digest sha256 = trail->digest();
    const std::lock_guard guard(mutex_);
    if (!trails_.emplace(sha256, trail).second) return;
    in_order_.push_back(sha256);
    blocks_ += trail->blocks();
    while (blocks_ > most_blocks_) {
      const auto oldest = trails_.find(in_order_.front());
      in_order_.pop_front();
      blocks_ -= oldest->second->blocks();
      trails_.erase(oldest);
    }
  }

 private:
  const std::size_t most_blocks_;
  mutable std::mutex mutex_;  // guards the rest
  std::map<Sha256Digest, std::shared_ptr<const HashTrail>> trails_;
  std::deque<Sha256Digest> in_order_;  // the oldest first
  std::size_t blocks_ = 0;
};

}  // namespace kiroku::crypto

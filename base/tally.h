// Counts what others may do as often as they like, so that telling of it stays bounded. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>

namespace kiroku {

class Tally {
 public:
  /// Beyond `most_keys` different ones, all further keys are counted as one. Of each key the first
  /// `told_each` are worth a sentence.
  explicit Tally(std::size_t most_keys = 256, std::uint64_t told_each = 1)
      : most_keys_(most_keys), told_each_(told_each) {}
  /// Counts one more of `key`. How many there are now if that is worth a sentence (the first ones, then every
  /// power of two), else nothing.
  std::optional<std::uint64_t> add(const std::string& key);
  [[nodiscard]] std::uint64_t total() const;

 private:
  const std::size_t most_keys_;
  const std::uint64_t told_each_;
  mutable std::mutex mutex_;
  std::map<std::string, std::uint64_t> counts_;
  std::uint64_t others_ = 0, total_ = 0;
};

}  // namespace kiroku

// A case's folder of which the segments stay in a store, read as if they lay there: for verification.
#pragma once

#include <cstdint>
#include <exception>
#include <filesystem>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <utility>

#include "archive/format/file_reading.h"
#include "fleet/fetching_ahead.h"
#include "fleet/object_store.h"
#include "fleet/store_connections.h"
#include "fleet/stored_segments.h"

namespace kiroku::fleet {

/// Where each file stands whose bytes stay in the store, there is one of its size without them
/// (FetchedCase::in_store). Thread-safe.
class StoredReading final : public archive::FileReading {
 public:
  /// `store` must outlive the object. `in_store`: by their paths below `folder`.
  StoredReading(StoreConnections& store, std::filesystem::path folder,
                std::map<std::string, ListedVersion> in_store)
      : store_(store), folder_(std::move(folder)), in_store_(std::move(in_store)) {}

  /// Of a file in the store its bytes there, in ranges; -1 and EIO where it does not give them.
  ssize_t read_at(int descriptor, std::uint64_t offset, std::span<std::byte> into,
                  const std::filesystem::path& path) const override;
  /// Throws what the store refused first, StoreError or kiroku::Error: what was found by then is no verdict.
  void require_all_given() const;

 private:
  [[nodiscard]] bool has_failed() const;
  /// Threads read a segment each, one range after the other.
  static constexpr std::size_t kMostBytes = std::size_t{64} << 20;
  static constexpr std::uint64_t kRangesAhead = 2;

  StoreConnections& store_;
  const std::filesystem::path folder_;
  const std::map<std::string, ListedVersion> in_store_;
  mutable std::mutex mutex_;  // guards the next
  mutable std::exception_ptr failure_;
  mutable RangeCache cache_{kMostBytes};
  mutable FetchingAhead ahead_;  // behind the cache, which it fills
};

}  // namespace kiroku::fleet

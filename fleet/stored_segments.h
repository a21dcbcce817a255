// Files of cases that stay in a store: read there, in ranges, and never copied as a whole.
#pragma once

#include <cstdint>
#include <future>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <tuple>
#include <utility>

#include "archive/format/ledger_entry.h"
#include "archive/reading/sealed_source.h"
#include "crypto/byte_source.h"
#include "fleet/store_connections.h"

namespace kiroku::fleet {

/// Ranges of objects that were read, in memory, whatever the case. What lies in a store is sealed.
/// Thread-safe.
class RangeCache {
 public:
  /// What is asked for at once: a segment of ten seconds at 4 Mbit/s has 5 MB.
  static constexpr std::size_t kRangeBytes = std::size_t{2} << 20;

  explicit RangeCache(std::size_t most_bytes = std::size_t{256} << 20) : most_(most_bytes) {}

  using Range = std::shared_ptr<const Bytes>;
  /// Range `number` of a version, which has `size` bytes; asked for once, whoever else wants it meanwhile.
  /// Throws as ObjectStore::get_range().
  Range get(StoreConnections& store, const std::string& key, const std::string& version, std::uint64_t size,
            std::uint64_t number);
  /// Bytes that came from the store so far.
  [[nodiscard]] std::uint64_t fetched_bytes() const;

 private:
  using Name = std::tuple<std::string, std::string, std::uint64_t>;
  struct Kept {
    std::shared_future<Range> range;
    std::list<Name>::iterator place;
    std::size_t bytes = 0;
  };
  void forget(const Name& name);
  const std::size_t most_;
  mutable std::mutex mutex_;
  std::map<Name, Kept> ranges_;
  std::list<Name> in_order_;  // what was used last in front
  std::size_t bytes_ = 0;
  std::uint64_t fetched_ = 0;
};

/// The segments of one appliance's case. Thread-safe.
class StoredSegments final : public archive::SealedSource {
 public:
  /// Both must outlive the object and what it opens. `prefix` is that of the case's objects:
  /// "or-1/20260805T091502Z-3f9c21ab/".
  StoredSegments(StoreConnections& store, RangeCache& cache, std::string prefix)
      : store_(store), cache_(cache), prefix_(std::move(prefix)) {}

  /// Where the object has several versions, the newest that has the entry's hash. Throws StoreError, and
  /// kiroku::Error where no version can be the segment.
  [[nodiscard]] std::unique_ptr<crypto::ByteSource> open(const archive::SegmentEntry& segment) const override;
  /// The same of any file that the ledger names.
  [[nodiscard]] std::unique_ptr<crypto::ByteSource> open(const archive::FileReference& file) const;

 private:
  [[nodiscard]] std::string version_of(const archive::FileReference& file) const;
  StoreConnections& store_;
  RangeCache& cache_;
  const std::string prefix_;
  mutable std::mutex mutex_;
  using Choice = std::pair<std::string, crypto::Sha256Digest>;  // a file's name and hash
  mutable std::map<Choice, std::string> versions_;              // that were chosen
};

}  // namespace kiroku::fleet

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
#include "fleet/fetching_ahead.h"
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

/// The segments of one appliance's case. Thread-safe. A segment is hashed whole when it is opened first: all
/// its ranges are asked for at once then.
class StoredSegments final : public archive::SealedSource,
                             public std::enable_shared_from_this<StoredSegments> {
 public:
  /// `store` and `cache` must outlive the object, what it opens, and `ahead`, which must outlive the object.
  /// `prefix` is that of the case's objects: "or-1/20260805T091502Z-3f9c21ab/".
  StoredSegments(StoreConnections& store, RangeCache& cache, FetchingAhead& ahead, std::string prefix)
      : store_(store), cache_(cache), ahead_(ahead), prefix_(std::move(prefix)) {}

  /// Where the object has several versions, the newest that has the entry's hash. Throws StoreError, and
  /// kiroku::Error where no version can be the segment.
  [[nodiscard]] std::unique_ptr<crypto::ByteSource> open(const archive::SegmentEntry& segment) const override;
  /// The same of any file that the ledger names.
  [[nodiscard]] std::unique_ptr<crypto::ByteSource> open(const archive::FileReference& file) const;
  /// Nothing of an object that std::make_shared did not make.
  void expect(const archive::SegmentEntry& segment) const override;

 private:
  struct Chosen {
    std::string version;
    bool is_recorded = true;  // as far as can be told before it is read
  };
  [[nodiscard]] Chosen choose_version(const archive::FileReference& file) const;
  /// Chosen once, whoever else asks meanwhile; and whether that was now.
  [[nodiscard]] std::pair<std::string, bool> version_of(const archive::FileReference& file) const;
  void fetch_ranges(const archive::FileReference& file, const std::string& version, std::uint64_t from) const;
  StoreConnections& store_;
  RangeCache& cache_;
  FetchingAhead& ahead_;
  const std::string prefix_;
  mutable std::mutex mutex_;
  using Choice = std::pair<std::string, crypto::Sha256Digest>;          // a file's name and hash
  mutable std::map<Choice, std::shared_future<std::string>> versions_;  // that were chosen
};

}  // namespace kiroku::fleet

#include "fleet/stored_segments.h"

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "archive/format/limits.h"
#include "base/error.h"
#include "base/printable.h"
#include "crypto/hashed_source.h"

namespace kiroku::fleet {
namespace {

/// Of one segment; whoever reads a longer one waits for the rest as it comes.
constexpr std::uint64_t kMostRangesAhead = 8;

/// One version of an object.
class StoredSource final : public crypto::ByteSource {
 public:
  StoredSource(StoreConnections& store, RangeCache& cache, std::string key, std::string version,
               std::uint64_t size)
      : store_(store), cache_(cache), key_(std::move(key)), version_(std::move(version)), size_(size) {}

  [[nodiscard]] std::uint64_t size() const override { return size_; }
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const override {
    if (offset >= size_) return 0;
    into = into.first(static_cast<std::size_t>(std::min<std::uint64_t>(into.size(), size_ - offset)));
    std::size_t filled = 0;
    while (filled < into.size()) {
      const std::uint64_t at = offset + filled;
      const RangeCache::Range range = cache_.get(store_, key_, version_, size_, at / RangeCache::kRangeBytes);
      const auto skipped = static_cast<std::size_t>(at % RangeCache::kRangeBytes);
      const std::size_t taken = std::min(into.size() - filled, range->size() - skipped);
      std::memcpy(into.data() + filled, range->data() + skipped, taken);
      filled += taken;
    }
    return filled;
  }

 private:
  StoreConnections& store_;
  RangeCache& cache_;
  const std::string key_, version_;
  const std::uint64_t size_;
};

}  // namespace

RangeCache::Range RangeCache::get(StoreConnections& store, const std::string& key, const std::string& version,
                                  std::uint64_t size, std::uint64_t number) {
  const Name name{key, version, number};
  std::promise<Range> promise;
  {
    std::unique_lock lock(mutex_);
    if (const auto found = ranges_.find(name); found != ranges_.end()) {
      in_order_.splice(in_order_.begin(), in_order_, found->second.place);
      const std::shared_future<Range> range = found->second.range;
      lock.unlock();
      return range.get();
    }
    in_order_.push_front(name);
    ranges_[name] = {promise.get_future().share(), in_order_.begin()};
  }
  try {
    const std::uint64_t offset = number * kRangeBytes;
    const auto wanted = static_cast<std::size_t>(std::min<std::uint64_t>(kRangeBytes, size - offset));
    auto range = std::make_shared<const Bytes>(
        store.with([&](ObjectStore& one) { return one.get_range(key, version, offset, wanted); }));
    if (range->size() != wanted) {
      throw Error("of " + key + " the store sent " + std::to_string(range->size()) + " bytes where it has " +
                  std::to_string(wanted) + " from byte " + std::to_string(offset) + " on: try again");
    }
    promise.set_value(range);
    const std::lock_guard guard(mutex_);
    fetched_ += wanted;
    // What was forgotten meanwhile may be there once more, by somebody else.
    if (const auto found = ranges_.find(name); found != ranges_.end() && found->second.bytes == 0) {
      found->second.bytes = wanted;
      bytes_ += wanted;
    }
    while (bytes_ > most_ && !in_order_.empty()) forget(Name(in_order_.back()));
    return range;
  } catch (...) {
    promise.set_exception(std::current_exception());
    const std::lock_guard guard(mutex_);
    forget(name);
    throw;
  }
}

void RangeCache::forget(const Name& name) {
  const auto found = ranges_.find(name);
  if (found == ranges_.end()) return;
  bytes_ -= found->second.bytes;
  in_order_.erase(found->second.place);
  ranges_.erase(found);
}

std::uint64_t RangeCache::fetched_bytes() const {
  const std::lock_guard guard(mutex_);
  return fetched_;
}

std::unique_ptr<crypto::ByteSource> StoredSegments::open(const archive::SegmentEntry& segment) const {
  return open(segment.file);
}

std::unique_ptr<crypto::ByteSource> StoredSegments::open(const archive::FileReference& file) const {
  if (!is_plain_key(file.file) || file.bytes > archive::kMaximumSealedBytes)
    throw Error("the ledger names '" + printable(file.file) + "' with " + std::to_string(file.bytes) +
                " bytes, which no store has of Kiroku");
  const auto [version, is_new] = version_of(file);
  // The first range is read by whoever opens it.
  if (is_new) fetch_ranges(file, version, 1);
  return std::make_unique<StoredSource>(store_, cache_, prefix_ + file.file, version, file.bytes);
}

void StoredSegments::expect(const archive::SegmentEntry& segment) const {
  const archive::FileReference& file = segment.file;
  if (!is_plain_key(file.file) || file.bytes > archive::kMaximumSealedBytes) return;
  {
    const std::lock_guard guard(mutex_);
    if (versions_.contains({file.file, file.sha256})) return;
  }
  ahead_.add([of = weak_from_this(), file] {
    const auto segments = of.lock();
    if (!segments) return;
    if (const auto [version, is_new] = segments->version_of(file); is_new)
      segments->fetch_ranges(file, version, 0);
  });
}

void StoredSegments::fetch_ranges(const archive::FileReference& file, const std::string& version,
                                  std::uint64_t from) const {
  const std::uint64_t most = from + kMostRangesAhead;
  for (std::uint64_t number = from; number < most && number * RangeCache::kRangeBytes < file.bytes;
       ++number) {
    ahead_.add([&store = store_, &cache = cache_, key = prefix_ + file.file, version, size = file.bytes,
                number] { static_cast<void>(cache.get(store, key, version, size, number)); });
  }
}

std::pair<std::string, bool> StoredSegments::version_of(const archive::FileReference& file) const {
  const Choice choice{file.file, file.sha256};
  std::promise<std::string> promise;
  {
    std::unique_lock lock(mutex_);
    if (const auto known = versions_.find(choice); known != versions_.end()) {
      const std::shared_future<std::string> version = known->second;
      lock.unlock();
      return {version.get(), false};
    }
    versions_[choice] = promise.get_future().share();
  }
  const auto forget = [&] {
    const std::lock_guard guard(mutex_);
    versions_.erase(choice);
  };
  try {
    Chosen chosen = choose_version(file);
    if (!chosen.is_recorded) forget();
    promise.set_value(chosen.version);
    return {std::move(chosen.version), true};
  } catch (...) {
    forget();
    promise.set_exception(std::current_exception());
    throw;
  }
}

// Whoever has the appliance's keys can put other versions; what the ledger names lies among the older ones.
StoredSegments::Chosen StoredSegments::choose_version(const archive::FileReference& file) const {
  const std::string key = prefix_ + file.file;
  bool is_there = false;
  std::vector<ListedVersion> versions;  // of the size that is stated, the newest in front
  store_.with([&](ObjectStore& store) {
    store.for_each_version(key, [&](const ListedVersion& each) {
      if (each.key != key) return;
      is_there = true;
      if (each.bytes != file.bytes) return;
      versions.insert(each.newest ? versions.begin() : versions.end(), each);
    });
  });
  versions = versions_to_try(std::move(versions));
  if (versions.empty()) {
    throw Error("the store " +
                (is_there ? "has no version of " + key + " with the " + std::to_string(file.bytes) +
                                " bytes that the ledger states"
                          : "has no " + key) +
                ": verify the case to see what else does not hold");
  }
  const auto has_the_hash = [&](const ListedVersion& version) {
    const StoredSource source(store_, cache_, key, version.version, file.bytes);
    return crypto::HashTrail::of(source).digest() == file.sha256;
  };
  // Of a single one the hash is compared by whoever reads it.
  const auto chosen = versions.size() == 1 ? versions.begin() : std::ranges::find_if(versions, has_the_hash);
  if (chosen == versions.end()) return {versions.front().version, false};
  return {chosen->version};
}

}  // namespace kiroku::fleet

#include "fleet/stored_reading.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace kiroku::fleet {

ssize_t StoredReading::read_at(int descriptor, std::uint64_t offset, std::span<std::byte> into,
                               const std::filesystem::path& path) const {
  const auto found = in_store_.find(path.lexically_relative(folder_).generic_string());
  if (found == in_store_.end()) return FileReading::read_at(descriptor, offset, into, path);
  const ListedVersion& version = found->second;
  if (offset >= version.bytes || into.empty()) return 0;
  if (has_failed()) {
    errno = EIO;
    return -1;
  }
  try {
    const std::uint64_t number = offset / RangeCache::kRangeBytes;
    const auto has = [&](std::uint64_t range) { return range * RangeCache::kRangeBytes < version.bytes; };
    const bool is_new = offset % RangeCache::kRangeBytes == 0;
    for (std::uint64_t next = number + 1; is_new && next <= number + kRangesAhead && has(next); ++next) {
      ahead_.add([this, &version, next] {
        static_cast<void>(cache_.get(store_, version.key, version.version, version.bytes, next));
      });
    }
    const RangeCache::Range range = cache_.get(store_, version.key, version.version, version.bytes, number);
    const auto skipped = static_cast<std::size_t>(offset % RangeCache::kRangeBytes);
    const std::size_t taken = std::min(into.size(), range->size() - skipped);
    std::memcpy(into.data(), range->data() + skipped, taken);
    return static_cast<ssize_t>(taken);
  } catch (const std::exception&) {
    const std::lock_guard guard(mutex_);
    if (!failure_) failure_ = std::current_exception();
    errno = EIO;
    return -1;
  }
}

// A store that is away is not asked for each segment once more.
bool StoredReading::has_failed() const {
  const std::lock_guard guard(mutex_);
  return failure_ != nullptr;
}

void StoredReading::require_all_given() const {
  const std::lock_guard guard(mutex_);
  if (failure_) std::rethrow_exception(failure_);
}

}  // namespace kiroku::fleet

#include "crypto/secret.h"

#include <algorithm>
#include <mutex>
#include <new>
#include <sys/mman.h>
#include <utility>
#include <vector>

#include <openssl/crypto.h>
#include <openssl/rand.h>

#include "base/error.h"
#include "crypto/openssl_handles.h"

namespace kiroku::crypto {
namespace {

std::byte* locked_memory(std::size_t size) {
  void* memory = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  // Both are best effort: a small RLIMIT_MEMLOCK must not stop a recording. The kernel joins neighbouring
  // mappings only in this order: mlock fills pages, and filled ones with different flags stay apart.
  static_cast<void>(madvise(memory, size, MADV_DONTDUMP));
  static_cast<void>(mlock(memory, size));
  return static_cast<std::byte*>(memory);
}

/// Keys and passphrases, many to a page: a process has 65,530 mappings and a hospital's service 8 MiB that
/// may be locked, and each key in pages of its own would take one mapping and 4 KiB. Pages stay locked and
/// are used again; locking works on whole pages, so that giving one back would unlock what else lies in it.
/// Thread-safe.
class SmallSecrets {
 public:
  static constexpr std::size_t kLargest = 128;

  /// Zero bytes.
  std::byte* take() {
    const std::lock_guard guard(mutex_);
    if (free_.empty()) add_page();
    std::byte* const slot = free_.back();
    free_.pop_back();
    return slot;
  }
  /// Of zero bytes again.
  void give_back(std::byte* slot) noexcept {
    const std::lock_guard guard(mutex_);
    free_.push_back(slot);  // there is room for every slot
  }

 private:
  static constexpr std::size_t kPage = 4096;

  void add_page() {
    constexpr std::size_t kSlots = kPage / kLargest;
    free_.reserve(slots_ + kSlots);
    std::byte* const page = locked_memory(kPage);
    slots_ += kSlots;
    for (std::size_t i = 0; i < kSlots; ++i) free_.push_back(page + i * kLargest);
  }

  std::mutex mutex_;
  std::size_t slots_ = 0;
  std::vector<std::byte*> free_;
};

SmallSecrets& small_secrets() {
  // Never destroyed: secrets of other static objects are given back later than it would be.
  static SmallSecrets& all = *new SmallSecrets;
  return all;
}

}  // namespace

Secret::Secret(std::size_t size) {
  if (size == 0) return;
  data_ = size <= SmallSecrets::kLargest ? small_secrets().take() : locked_memory(size);
  size_ = size;
}

Secret Secret::copy_of(ByteView bytes) {
  Secret result(bytes.size());
  std::ranges::copy(bytes, result.data_);
  return result;
}

Secret Secret::copy_of(std::string_view text) { return copy_of(bytes_of(text)); }

Secret Secret::random(std::size_t size) {
  Secret result(size);
  fill_random(result.bytes());
  return result;
}

Secret::Secret(Secret&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}

Secret& Secret::operator=(Secret&& other) noexcept {
  if (this == &other) return *this;
  std::swap(data_, other.data_);
  std::swap(size_, other.size_);
  Secret released(std::move(other));
  return *this;
}

Secret::~Secret() {
  if (data_ == nullptr) return;
  zeroise(bytes());
  if (size_ <= SmallSecrets::kLargest) {
    small_secrets().give_back(data_);
  } else {
    munmap(data_, size_);  // unlocks, too
  }
}

std::string_view Secret::text() const { return text_of(bytes()); }

Secret Secret::clone() const { return copy_of(bytes()); }

void zeroise(std::span<std::byte> bytes) { OPENSSL_cleanse(bytes.data(), bytes.size()); }

bool equal_constant_time(ByteView a, ByteView b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

void fill_random(std::span<std::byte> bytes) {
  // RAND_bytes counts in int; nothing here asks for more than a few kilobytes, but a span may.
  constexpr std::size_t kStep = 1 << 20;
  while (!bytes.empty()) {
    const auto part = bytes.first(std::min(bytes.size(), kStep));
    if (RAND_bytes(openssl_bytes(part), static_cast<int>(part.size())) != 1)
      throw Error("cannot get random bytes from the system: OpenSSL reports " + last_openssl_error());
    bytes = bytes.subspan(part.size());
  }
}

}  // namespace kiroku::crypto

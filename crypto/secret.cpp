#include "crypto/secret.h"

#include <algorithm>
#include <new>
#include <sys/mman.h>
#include <utility>

#include <openssl/crypto.h>
#include <openssl/rand.h>

#include "base/error.h"
#include "crypto/openssl_handles.h"

namespace kiroku::crypto {

// Each secret has pages of its own: locking works on whole pages, so two secrets in one page would unlock
// each other.
Secret::Secret(std::size_t size) {
  if (size == 0) return;
  void* memory = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  // Both are best effort: a small RLIMIT_MEMLOCK must not stop a recording.
  static_cast<void>(mlock(memory, size));
  static_cast<void>(madvise(memory, size, MADV_DONTDUMP));
  data_ = static_cast<std::byte*>(memory);
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
  munmap(data_, size_);  // unlocks, too
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

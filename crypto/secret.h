// Memory for keys and passphrases: locked against swapping where the system allows it (mlock, best effort
// within RLIMIT_MEMLOCK), excluded from core dumps, zeroised on destruction. Never printed: there is no
// operator<<.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "base/bytes.h"

namespace kiroku::crypto {

/// An owned run of secret bytes. Move-only. Not thread-safe.
class Secret {
 public:
  Secret() = default;
  /// `size` zero bytes.
  explicit Secret(std::size_t size);
  /// A copy of `bytes`; the caller zeroises its own.
  static Secret copy_of(ByteView bytes);
  static Secret copy_of(std::string_view text);
  /// `size` bytes of the system's random generator.
  static Secret random(std::size_t size);

  Secret(Secret&& other) noexcept;
  Secret& operator=(Secret&& other) noexcept;
  Secret(const Secret&) = delete;
  Secret& operator=(const Secret&) = delete;
  ~Secret();

  [[nodiscard]] std::span<std::byte> bytes() { return {data_, size_}; }
  [[nodiscard]] ByteView bytes() const { return {data_, size_}; }
  [[nodiscard]] std::string_view text() const;
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] Secret clone() const;

 private:
  std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

/// Overwrites `bytes` with zeros in a way the compiler may not remove.
void zeroise(std::span<std::byte> bytes);
/// Comparison whose time does not depend on the contents.
bool equal_constant_time(ByteView a, ByteView b);
/// Fills with the system's random generator; throws kiroku::Error if it fails.
void fill_random(std::span<std::byte> bytes);

}  // namespace kiroku::crypto

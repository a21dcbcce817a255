// Owns a file descriptor. Header-only; one thread at a time.
#pragma once

#include <unistd.h>
#include <utility>

namespace kiroku {

/// Closes what it holds. What close() reports is not looked at: whoever needs to know has synced before.
class Descriptor {
 public:
  /// Takes `number`; a negative one, as open() returns where it fails, is none.
  explicit Descriptor(int number = -1) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  [[nodiscard]] int number() const { return number_; }
  explicit operator bool() const { return number_ >= 0; }
  /// Gives it away unclosed.
  [[nodiscard]] int release() { return std::exchange(number_, -1); }

 private:
  int number_;
};

}  // namespace kiroku

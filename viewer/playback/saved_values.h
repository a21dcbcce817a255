// Values into bytes and back, for this program's own cache: what one object saved another of the same program
// restores. Objects belong to one thread.
#pragma once

#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/bytes.h"

namespace kiroku::playback {

/// Plain values one after the other, in this machine's order: what is saved is read by the same program.
class Saver {
 public:
  template <typename Value>
  void number(Value value) {
    static_assert(std::is_trivially_copyable_v<Value>);
    append(bytes_, std::as_bytes(std::span(&value, 1)));
  }
  void text(const std::string& value) {
    number(value.size());
    append(bytes_, bytes_of(value));
  }
  template <typename Value>
  void list(const std::vector<Value>& values) {
    static_assert(std::is_trivially_copyable_v<Value>);
    number(values.size());
    append(bytes_, std::as_bytes(std::span(values)));
  }
  Bytes take() { return std::move(bytes_); }

 private:
  Bytes bytes_;
};

/// After the first thing that does not fit everything is empty, and whole() false.
class Restorer {
 public:
  explicit Restorer(ByteView bytes) : bytes_(bytes) {}
  template <typename Value>
  Value number() {
    Value value{};
    const ByteView taken = take(sizeof value);
    if (!taken.empty()) std::memcpy(&value, taken.data(), sizeof value);
    return value;
  }
  std::string text() { return std::string(text_of(take(number<std::size_t>()))); }
  template <typename Value>
  std::vector<Value> list() {
    const auto count = number<std::size_t>();
    if (count > bytes_.size() / sizeof(Value)) fits_ = false;
    std::vector<Value> values(fits_ ? count : 0);
    if (const ByteView taken = take(values.size() * sizeof(Value)); !taken.empty()) {
      std::memcpy(values.data(), taken.data(), taken.size());
    }
    return values;
  }
  [[nodiscard]] bool fits() const { return fits_; }
  [[nodiscard]] bool whole() const { return fits_ && bytes_.empty(); }

 private:
  ByteView take(std::size_t count) {
    if (count > bytes_.size()) fits_ = false;
    if (!fits_) return {};
    const ByteView taken = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return taken;
  }

  ByteView bytes_;
  bool fits_ = true;
};

}  // namespace kiroku::playback

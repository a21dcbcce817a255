// What a recorder holds in memory as bytes, for the one that starts after it on the same running machine. A
// value is written and read by one list of its members (procedure_book_state.cpp), so that both agree.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "base/bytes.h"
#include "base/error.h"
#include "recorder/procedure/procedure_book.h"

namespace kiroku::recorder {

/// Values one behind the other: numbers as eight bytes, texts and lists behind their length.
class StateWriter {
 public:
  static constexpr bool kReads = false;

  template <typename... Values>
  void all(const Values&... values) {
    (one(values), ...);
  }
  void one(std::uint64_t number) {
    for (int shift = 0; shift < 64; shift += 8)
      bytes_.push_back(static_cast<std::byte>((number >> shift) & 0xFFU));
  }
  void one(bool is) { bytes_.push_back(static_cast<std::byte>(is ? 1 : 0)); }
  void one(const std::string& text) { view(bytes_of(text)); }
  void one(const Bytes& bytes) { view(bytes); }
  void one(const ProcedureMoment& moment) {
    one(static_cast<std::uint64_t>(moment.utc.time_since_epoch().count()));
    one(static_cast<std::uint64_t>(moment.since_boot.count()));
  }
  void within_bounds(const ProcedureMoment& moment) { one(moment); }
  [[nodiscard]] Bytes take() { return std::move(bytes_); }

 private:
  void view(ByteView bytes) {
    one(static_cast<std::uint64_t>(bytes.size()));
    append(bytes_, bytes);
  }

  Bytes bytes_;
};

/// Throws kiroku::Error for what no StateWriter wrote, as far as the bytes show it: nothing beyond them is
/// read, and no number is one that the arithmetic of times cannot hold.
class StateReader {
 public:
  static constexpr bool kReads = true;

  explicit StateReader(ByteView bytes) : left_(bytes) {}

  template <typename... Values>
  void all(Values&... values) {
    (one(values), ...);
  }
  void one(std::uint64_t& number) {
    number = 0;
    int shift = 0;
    for (const std::byte each : take(sizeof number)) {
      number |= std::to_integer<std::uint64_t>(each) << shift;
      shift += 8;
    }
  }
  void one(bool& is) {
    const auto value = std::to_integer<unsigned>(take(1).front());
    if (value > 1) refuse();
    is = value == 1;
  }
  void one(std::string& text) {
    const ByteView bytes = take(length());
    text = text_of(bytes);
  }
  void one(Bytes& bytes) { bytes = to_bytes(take(length())); }
  void one(ProcedureMoment& moment) {
    const bool before = std::exchange(is_beyond_bounds_, false);
    within_bounds(moment);
    if (std::exchange(is_beyond_bounds_, before)) refuse();
  }
  /// As one(), but a time that none can be is noted: it costs what it belongs to alone.
  void within_bounds(ProcedureMoment& moment) {
    // The year 10000 and a week: "no end" is planned for the last second before, in whatever zone.
    constexpr std::uint64_t kLatest_us = 253'402'300'800'000'000 + 7 * 86'400'000'000ULL;
    constexpr std::uint64_t kLongest_ns = 3'153'600'000'000'000'000U;  // a hundred years since the boot
    std::uint64_t utc = 0, since_boot = 0;
    all(utc, since_boot);
    const bool is_one = utc < kLatest_us && since_boot < kLongest_ns;
    is_beyond_bounds_ = is_beyond_bounds_ || !is_one;
    moment = {UtcTime(UtcTime::duration(is_one ? static_cast<std::int64_t>(utc) : 0)),
              Clock::Duration(is_one ? static_cast<std::int64_t>(since_boot) : 0)};
  }
  /// Whether that was so since it was asked last.
  [[nodiscard]] bool was_beyond_bounds() { return std::exchange(is_beyond_bounds_, false); }
  /// Of a list whose members have a byte at least.
  [[nodiscard]] std::size_t length() { return static_cast<std::size_t>(number_below(left_.size() + 1)); }
  [[nodiscard]] std::int64_t number_below(std::uint64_t bound) {
    std::uint64_t number = 0;
    one(number);
    if (number >= bound) refuse();
    return static_cast<std::int64_t>(number);
  }
  void require_end() const {
    if (!left_.empty()) refuse();
  }
  [[noreturn]] static void refuse() { throw Error("it is damaged, or another version wrote it"); }

 private:
  ByteView take(std::size_t count) {
    if (count > left_.size()) refuse();
    const ByteView taken = left_.first(count);
    left_ = left_.subspan(count);
    return taken;
  }

  ByteView left_;
  bool is_beyond_bounds_ = false;
};

}  // namespace kiroku::recorder

#include "base/time_text.h"

#include <array>
#include <charconv>
#include <utility>

namespace kiroku {
namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr std::size_t kMostDigits = 8;
constexpr std::size_t kMostDecimals = 9;
constexpr std::int64_t kMostSeconds = 10'000LL * 3600;

struct Number {
  std::int64_t whole = 0;
  std::int64_t billionths = 0;
  std::size_t digits = 0;
  bool has_decimals = false;
};

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Digits at the front, with decimals where there are some, which are cut off.
std::optional<Number> take_number(std::string_view& text) {
  Number number;
  while (number.digits < text.size() && is_digit(text[number.digits])) ++number.digits;
  if (number.digits == 0 || number.digits > kMostDigits) return std::nullopt;
  std::from_chars(text.data(), text.data() + number.digits, number.whole);
  text.remove_prefix(number.digits);
  if (!text.starts_with('.')) return number;
  text.remove_prefix(1);
  std::size_t decimals = 0;
  std::int64_t unit = kNsPerSecond;
  while (decimals < text.size() && is_digit(text[decimals])) {
    if (decimals == kMostDecimals) return std::nullopt;
    unit /= 10;
    number.billionths += (text[decimals++] - '0') * unit;
  }
  if (decimals == 0) return std::nullopt;
  text.remove_prefix(decimals);
  number.has_decimals = true;
  return number;
}

/// So many units of `unit_ns`, which is whole milliseconds; to the nanosecond.
std::int64_t in_ns(const Number& number, std::int64_t unit_ns) {
  return number.whole * unit_ns + number.billionths * (unit_ns / 1'000'000) / 1000;
}

std::optional<std::int64_t> bounded(std::int64_t ns) {
  return ns <= kMostSeconds * kNsPerSecond ? std::optional(ns) : std::nullopt;
}

/// "m:ss[.f…]" or "h:mm:ss[.f…]".
std::optional<std::int64_t> parse_clock(std::string_view text) {
  constexpr std::int64_t kSixty = 60;
  std::int64_t whole = 0;
  for (int part = 0; part < 3; ++part) {
    const std::optional<Number> number = take_number(text);
    if (!number) return std::nullopt;
    if (part > 0 && (number->digits != 2 || number->whole >= kSixty)) return std::nullopt;
    whole = whole * kSixty + number->whole;
    if (whole > kMostSeconds) return std::nullopt;
    if (text.empty()) {
      if (part == 0) return std::nullopt;
      return bounded(whole * kNsPerSecond + number->billionths);
    }
    if (number->has_decimals || !text.starts_with(':')) return std::nullopt;
    text.remove_prefix(1);
  }
  return std::nullopt;
}

/// "1h2m3.5s": each unit once, the larger first.
std::optional<std::int64_t> parse_units(std::string_view text) {
  struct Unit {
    std::string_view name;
    std::int64_t ns;
    std::size_t rank;
  };
  // Of two that begin alike the longer one first.
  constexpr std::array<Unit, 5> kUnits{{{"h", 3600 * kNsPerSecond, 0},
                                        {"min", 60 * kNsPerSecond, 1},
                                        {"ms", kNsPerSecond / 1000, 3},
                                        {"m", 60 * kNsPerSecond, 1},
                                        {"s", kNsPerSecond, 2}}};
  std::int64_t sum = 0;
  std::size_t next_rank = 0;
  while (!text.empty()) {
    const std::optional<Number> number = take_number(text);
    if (!number) return std::nullopt;
    const Unit* found = nullptr;
    for (const Unit& unit : kUnits) {
      if (text.starts_with(unit.name)) {
        found = &unit;
        break;
      }
    }
    if (found == nullptr || found->rank < next_rank) return std::nullopt;
    text.remove_prefix(found->name.size());
    if (number->has_decimals && !text.empty()) return std::nullopt;
    if (number->whole > kMostSeconds * kNsPerSecond / found->ns) return std::nullopt;
    sum += in_ns(*number, found->ns);
    next_rank = found->rank + 1;
  }
  return bounded(sum);
}

}  // namespace

std::optional<std::int64_t> parse_time_text(std::string_view text) {
  if (text.find(':') != std::string_view::npos) return parse_clock(text);
  std::string_view rest = text;
  const std::optional<Number> seconds = take_number(rest);
  if (!seconds) return std::nullopt;
  if (!rest.empty()) return parse_units(text);
  return bounded(in_ns(*seconds, kNsPerSecond));
}

}  // namespace kiroku

#include "crypto/utf8.h"

#include <cstdint>
#include <optional>

namespace kiroku::crypto {
namespace {

// The code point at the front of `text`, which it cuts off; nothing if it is malformed.
std::optional<std::uint32_t> take_code_point(std::string_view& text) {
  const auto first = static_cast<std::uint8_t>(text.front());
  text.remove_prefix(1);
  if (first < 0x80) return first;
  unsigned more = 0;
  std::uint32_t value = 0;
  std::uint32_t smallest = 0;
  if ((first & 0xe0) == 0xc0) {
    more = 1, value = first & 0x1f, smallest = 0x80;
  } else if ((first & 0xf0) == 0xe0) {
    more = 2, value = first & 0x0f, smallest = 0x800;
  } else if ((first & 0xf8) == 0xf0) {
    more = 3, value = first & 0x07, smallest = 0x10000;
  } else {
    return std::nullopt;
  }
  for (; more > 0; --more) {
    if (text.empty()) return std::nullopt;
    const auto next = static_cast<std::uint8_t>(text.front());
    if ((next & 0xc0) != 0x80) return std::nullopt;
    text.remove_prefix(1);
    value = value << 6 | (next & 0x3f);
  }
  const bool surrogate = value >= 0xd800 && value <= 0xdfff;
  if (value < smallest || value > 0x10ffff || surrogate) return std::nullopt;
  return value;
}

bool is_space(std::uint32_t c) {
  return (c >= 0x09 && c <= 0x0d) || c == 0x20 || c == 0x85 || c == 0xa0 || c == 0x1680 ||
         (c >= 0x2000 && c <= 0x200a) || c == 0x2028 || c == 0x2029 || c == 0x202f || c == 0x205f ||
         c == 0x3000;
}

}  // namespace

bool is_utf8(std::string_view text) {
  while (!text.empty())
    if (!take_code_point(text)) return false;
  return true;
}

bool has_unicode_space(std::string_view text) {
  while (!text.empty()) {
    const auto c = take_code_point(text);
    if (c && is_space(*c)) return true;
  }
  return false;
}

}  // namespace kiroku::crypto

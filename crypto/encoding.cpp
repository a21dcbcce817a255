#include "crypto/encoding.h"

#include <algorithm>
#include <array>
#include <cstdint>

#include "base/ascii.h"

namespace kiroku::crypto {
namespace {

constexpr std::string_view kHexDigits = "0123456789abcdef";
constexpr std::string_view kBase64Alphabet =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr std::string_view kBech32Alphabet = "qpzry9x8gf2tvdw0s3jn54khce6mua7l";
constexpr std::uint8_t kForeign = 0xff;

// From a character to its place in an alphabet, kForeign for all others.
constexpr std::array<std::uint8_t, 256> inverse(std::string_view alphabet) {
  std::array<std::uint8_t, 256> table{};
  table.fill(kForeign);
  for (std::size_t i = 0; i < alphabet.size(); ++i)
    table[static_cast<std::uint8_t>(alphabet[i])] = static_cast<std::uint8_t>(i);
  return table;
}

constexpr auto kHexValues = inverse(kHexDigits);
constexpr auto kBase64Values = inverse(kBase64Alphabet);
constexpr auto kBech32Values = inverse(kBech32Alphabet);

std::uint8_t value_of(const std::array<std::uint8_t, 256>& table, char c) {
  return table[static_cast<std::uint8_t>(c)];
}

// BIP 173's checksum polynomial over 5-bit values.
class Bech32Checksum {
 public:
  explicit Bech32Checksum(std::string_view lower_human_part) {
    for (const char c : lower_human_part) add(static_cast<std::uint8_t>(c) >> 5);
    add(0);
    for (const char c : lower_human_part) add(static_cast<std::uint8_t>(c) & 31);
  }
  void add(unsigned value) {
    constexpr std::array<std::uint32_t, 5> kGenerator = {0x3b6a57b2, 0x26508e6d, 0x1ea119fa, 0x3d4233dd,
                                                         0x2a1462b3};
    const std::uint32_t top = state_ >> 25;
    state_ = (state_ & 0x1ffffff) << 5 ^ value;
    for (std::size_t i = 0; i < kGenerator.size(); ++i)
      if ((top >> i & 1) != 0) state_ ^= kGenerator[i];
  }
  [[nodiscard]] std::uint32_t state() const { return state_; }

 private:
  std::uint32_t state_ = 1;
};

constexpr std::size_t kBech32ChecksumLength = 6;

}  // namespace

std::string to_hex(ByteView bytes) {
  std::string text;
  text.reserve(2 * bytes.size());
  for (const std::byte byte : bytes) {
    const auto value = std::to_integer<unsigned>(byte);
    text += kHexDigits[value >> 4];
    text += kHexDigits[value & 15];
  }
  return text;
}

std::optional<Bytes> from_hex(std::string_view text) {
  if (text.size() % 2 != 0) return std::nullopt;
  Bytes bytes;
  bytes.reserve(text.size() / 2);
  for (std::size_t i = 0; i < text.size(); i += 2) {
    const unsigned high = value_of(kHexValues, text[i]);
    const unsigned low = value_of(kHexValues, text[i + 1]);
    if (high == kForeign || low == kForeign) return std::nullopt;
    bytes.push_back(static_cast<std::byte>(high << 4 | low));
  }
  return bytes;
}

std::string to_base64(ByteView bytes, Base64Padding padding) {
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  std::uint32_t held = 0;
  unsigned held_bits = 0;
  for (const std::byte byte : bytes) {
    held = held << 8 | std::to_integer<std::uint32_t>(byte);
    held_bits += 8;
    while (held_bits >= 6) {
      held_bits -= 6;
      text += kBase64Alphabet[held >> held_bits & 63];
    }
  }
  if (held_bits > 0) text += kBase64Alphabet[held << (6 - held_bits) & 63];
  if (padding == Base64Padding::kPadded) text.resize((text.size() + 3) / 4 * 4, '=');
  return text;
}

std::optional<Bytes> from_base64(std::string_view text, Base64Padding padding) {
  if (padding == Base64Padding::kPadded) {
    if (text.size() % 4 != 0) return std::nullopt;
    for (int i = 0; i < 2 && text.ends_with('='); ++i) text.remove_suffix(1);
  }
  if (text.size() % 4 == 1) return std::nullopt;
  Bytes bytes;
  bytes.reserve(text.size() / 4 * 3 + 2);
  std::uint32_t held = 0;
  unsigned held_bits = 0;
  for (const char c : text) {
    const std::uint32_t value = value_of(kBase64Values, c);
    if (value == kForeign) return std::nullopt;
    held = held << 6 | value;
    held_bits += 6;
    if (held_bits >= 8) {
      held_bits -= 8;
      bytes.push_back(static_cast<std::byte>(held >> held_bits));
    }
  }
  // What is left over are bits that an encoder sets to zero.
  if ((held & ((1U << held_bits) - 1)) != 0) return std::nullopt;
  return bytes;
}

std::string to_bech32(std::string_view human_part, ByteView bytes) {
  const bool upper = std::ranges::any_of(human_part, [](char c) { return c >= 'A' && c <= 'Z'; });
  std::string text;
  text.reserve(human_part.size() + 1 + (bytes.size() * 8 + 4) / 5 + kBech32ChecksumLength);
  std::ranges::transform(human_part, std::back_inserter(text), ascii_lower);
  Bech32Checksum checksum(text);
  text += '1';
  const auto put = [&](std::uint32_t value) {
    checksum.add(value);
    text += kBech32Alphabet[value];
  };
  std::uint32_t held = 0;
  unsigned held_bits = 0;
  for (const std::byte byte : bytes) {
    held = held << 8 | std::to_integer<std::uint32_t>(byte);
    held_bits += 8;
    while (held_bits >= 5) {
      held_bits -= 5;
      put(held >> held_bits & 31);
    }
  }
  if (held_bits > 0) put(held << (5 - held_bits) & 31);
  for (std::size_t i = 0; i < kBech32ChecksumLength; ++i) checksum.add(0);
  const std::uint32_t sum = checksum.state() ^ 1;
  for (unsigned i = 0; i < kBech32ChecksumLength; ++i) text += kBech32Alphabet[sum >> (5 * (5 - i)) & 31];
  if (upper) std::ranges::transform(text, text.begin(), ascii_upper);
  return text;
}

std::optional<Bech32> from_bech32(std::string_view text) {
  const auto is_lower = [](char c) { return c >= 'a' && c <= 'z'; };
  const auto is_upper = [](char c) { return c >= 'A' && c <= 'Z'; };
  if (std::ranges::any_of(text, is_lower) && std::ranges::any_of(text, is_upper)) return std::nullopt;
  const std::size_t separator = text.rfind('1');
  if (separator == std::string_view::npos || separator == 0) return std::nullopt;
  Bech32 result;
  result.human_part = text.substr(0, separator);
  if (std::ranges::any_of(result.human_part, [](char c) { return c < 33 || c > 126; })) return std::nullopt;
  std::string_view data = text.substr(separator + 1);
  if (data.size() < kBech32ChecksumLength) return std::nullopt;

  std::string lower_human_part = result.human_part;
  std::ranges::transform(lower_human_part, lower_human_part.begin(), ascii_lower);
  Bech32Checksum checksum(lower_human_part);
  std::uint32_t held = 0;
  unsigned held_bits = 0;
  const std::size_t payload_length = data.size() - kBech32ChecksumLength;
  result.bytes.reserve(payload_length * 5 / 8);
  for (std::size_t i = 0; i < data.size(); ++i) {
    const std::uint32_t value = value_of(kBech32Values, ascii_lower(data[i]));
    if (value == kForeign) return std::nullopt;
    checksum.add(value);
    if (i >= payload_length) continue;
    held = held << 5 | value;
    held_bits += 5;
    if (held_bits >= 8) {
      held_bits -= 8;
      result.bytes.push_back(static_cast<std::byte>(held >> held_bits));
    }
  }
  if (checksum.state() != 1) return std::nullopt;
  if (held_bits >= 5 || (held & ((1U << held_bits) - 1)) != 0) return std::nullopt;
  return result;
}

}  // namespace kiroku::crypto

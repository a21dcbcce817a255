#include "base/network_address.h"

#include <algorithm>
#include <arpa/inet.h>
#include <charconv>
#include <netinet/in.h>
#include <optional>

#include "base/error.h"

namespace kiroku {
namespace {

using Bits = std::array<std::uint8_t, 16>;

constexpr unsigned kAllBits = 128, kBitsBeforeVersion4 = 96;
constexpr std::size_t kHolderBytes = 8;  // a /64
constexpr Bits kVersion4{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF, 0, 0, 0, 0};

std::optional<Bits> bits_of(std::string_view text) {
  // A link-local address may name its interface: "fe80::1%eth0".
  const std::string address(text.substr(0, text.find('%')));
  Bits bits{};
  if (::inet_pton(AF_INET6, address.c_str(), bits.data()) == 1) return bits;
  bits = kVersion4;
  if (::inet_pton(AF_INET, address.c_str(), bits.data() + kBitsBeforeVersion4 / 8) == 1) return bits;
  return {};
}

bool is_version_4(const Bits& bits) {
  return std::equal(bits.begin(), bits.begin() + kBitsBeforeVersion4 / 8, kVersion4.begin());
}

std::string text_of_bits(const Bits& bits) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (is_version_4(bits)) {
    ::inet_ntop(AF_INET, bits.data() + kBitsBeforeVersion4 / 8, text.data(), text.size());
  } else {
    ::inet_ntop(AF_INET6, bits.data(), text.data(), text.size());
  }
  return text.data();
}

Bits cut(Bits bits, unsigned leading) {
  for (unsigned bit = leading; bit < kAllBits; ++bit) {
    bits[bit / 8] = static_cast<std::uint8_t>(bits[bit / 8] & ~(0x80U >> (bit % 8)));
  }
  return bits;
}

}  // namespace

std::string address_holder(const std::string& address) {
  std::optional<Bits> bits = bits_of(address);
  if (!bits) return address;
  if (!is_version_4(*bits)) std::fill(bits->begin() + kHolderBytes, bits->end(), std::uint8_t{0});
  return text_of_bits(*bits);
}

AddressRange AddressRange::parse(std::string_view text) {
  const std::size_t slash = text.find('/');
  const std::optional<Bits> bits = bits_of(text.substr(0, slash));
  const bool is_4 = bits && text.find(':') == std::string_view::npos;
  const unsigned most = is_4 ? kAllBits - kBitsBeforeVersion4 : kAllBits;
  unsigned leading = most;
  bool is_good = bits.has_value() && text.find('%') == std::string_view::npos;
  if (slash != std::string_view::npos) {
    const std::string_view digits = text.substr(slash + 1);
    const auto [end, failure] = std::from_chars(digits.data(), digits.data() + digits.size(), leading);
    is_good = is_good && failure == std::errc() && end == digits.data() + digits.size() && leading <= most;
  }
  if (!is_good) {
    throw UsageError("'" + std::string(text) +
                     "' is no address or range: write it as 192.168.7.20, 192.168.7.0/24 or fd00::/8");
  }
  leading += kAllBits - most;
  if (const Bits start = cut(*bits, leading); start != *bits) {
    throw UsageError("'" + std::string(text) + "' has bits beyond its range: did you mean " +
                     text_of_bits(start) + std::string(text.substr(slash)) + ", or the one address?");
  }
  return {*bits, leading};
}

std::vector<AddressRange> AddressRange::parse_list(std::string_view text) {
  std::vector<AddressRange> out;
  for (;;) {
    const std::size_t comma = text.find(',');
    out.push_back(parse(text.substr(0, comma)));
    if (comma == std::string_view::npos) return out;
    text.remove_prefix(comma + 1);
  }
}

bool AddressRange::contains(const std::string& address) const {
  const std::optional<Bits> bits = bits_of(address);
  return bits && cut(*bits, leading_) == start_;
}

bool any_contains(const std::vector<AddressRange>& ranges, const std::string& address) {
  return std::ranges::any_of(ranges, [&](const AddressRange& range) { return range.contains(address); });
}

}  // namespace kiroku

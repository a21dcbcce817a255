// Addresses of machines that connect, and lists of them as people write them: "192.168.7.0/24", "fd00::/8".
// Pure functions and values, thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace kiroku {

/// Whose connection it is for a limit: the address of IPv4 itself, of IPv6 the /64 it lies in ("fd00:1::"),
/// since one customer has all of those to choose from. IPv4 written as IPv6 is IPv4. What is no address
/// stands for itself.
std::string address_holder(const std::string& address);

/// Addresses with the same leading bits.
class AddressRange {
 public:
  /// "ADDRESS/BITS", or one address. Throws kiroku::UsageError for anything else, and where bits beyond BITS
  /// are set: "10.1.2.3/8" is a slip of somebody who meant another range.
  static AddressRange parse(std::string_view text);
  /// Several, separated by commas. Throws as parse(), and for an empty list.
  static std::vector<AddressRange> parse_list(std::string_view text);
  /// False for what is no address.
  [[nodiscard]] bool contains(const std::string& address) const;

 private:
  using Bits = std::array<std::uint8_t, 16>;  // IPv4 as ::ffff:a.b.c.d
  AddressRange(Bits start, unsigned leading) : start_(start), leading_(leading) {}
  Bits start_;
  unsigned leading_;
};

/// Whether one of them contains it.
bool any_contains(const std::vector<AddressRange>& ranges, const std::string& address);

}  // namespace kiroku

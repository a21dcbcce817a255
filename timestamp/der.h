// The little of ASN.1 (X.690) that OpenSSL's templates do not give: splitting a TimeStampResp without
// touching its token, reading ESSCertID, the versions that CMS keeps private, and writing rejections. A
// bounded cursor over bytes that must outlive it; values only, thread-safe.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>

#include "base/bytes.h"

namespace kiroku::timestamp {

/// Identifier octets used here (class, constructed bit and tag number in one octet).
namespace der {
inline constexpr std::uint8_t kInteger = 0x02;
inline constexpr std::uint8_t kBitString = 0x03;
inline constexpr std::uint8_t kOctetString = 0x04;
inline constexpr std::uint8_t kObjectIdentifier = 0x06;
inline constexpr std::uint8_t kUtf8String = 0x0c;
inline constexpr std::uint8_t kSequence = 0x30;
inline constexpr std::uint8_t kSet = 0x31;
inline constexpr std::uint8_t kContext0 = 0xa0;
inline constexpr std::uint8_t kContext4 = 0xa4;
}  // namespace der

/// One value: identifier octet, its contents, and identifier, length and contents together.
struct DerElement {
  std::uint8_t identifier = 0;
  ByteView content;
  ByteView whole;
};

/// What lengths are accepted: DER allows only the shortest definite form; BER (which CMS permits) also longer
/// and indefinite ones, nested at most 32 deep here.
enum class Encoding { kDer, kBer };

/// Reads values one after the other. A failed read leaves the cursor where it was.
class DerReader {
 public:
  explicit DerReader(ByteView bytes, Encoding encoding = Encoding::kDer)
      : rest_(bytes), encoding_(encoding) {}
  [[nodiscard]] bool at_end() const { return rest_.empty(); }
  [[nodiscard]] ByteView rest() const { return rest_; }
  /// The next value; nothing at the end, for a length beyond the end, or for a tag number above 30.
  std::optional<DerElement> next();
  /// The next value if it has this identifier octet.
  std::optional<DerElement> next(std::uint8_t identifier);

 private:
  ByteView rest_;
  Encoding encoding_;
};

/// The only value in `bytes`, if it has this identifier and nothing follows.
std::optional<DerElement> sole_element(ByteView bytes, std::uint8_t identifier);

/// DER of one value around the given contents, in order.
Bytes der_value(std::uint8_t identifier, std::initializer_list<ByteView> contents);

}  // namespace kiroku::timestamp

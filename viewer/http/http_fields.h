// What a browser sends, read strictly: request targets (RFC 3986), cookies (RFC 6265), byte ranges (RFC 9110
// section 14), accepted encodings and languages (RFC 9110 section 12.5). Pure functions, thread-safe; none
// throws but std::bad_alloc.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace kiroku::viewer {

/// A request target in origin form, decoded.
struct Target {
  /// What lies between the slashes: "/api/cases" is {"api", "cases"}, "/" is {}. Never empty, "." or "..",
  /// and never with a slash, a backslash or a control character in it, however that was written.
  std::vector<std::string> segments;
  /// In the order they stand; a name may come twice.
  std::vector<std::pair<std::string, std::string>> query;
};
/// Nothing for a target that is not in origin form, has a malformed escape, is not UTF-8, or has a segment
/// that Target excludes; in the query '+' is a space.
std::optional<Target> parse_target(std::string_view target);

/// The value of a cookie in a Cookie field; nothing if it is absent or stands there twice.
std::optional<std::string> cookie_value(std::string_view field, std::string_view name);

/// [first, last], both included.
struct ByteRange {
  std::uint64_t first = 0, last = 0;
  [[nodiscard]] std::uint64_t size() const { return last - first + 1; }
};
/// What a Range field asks of `size` bytes.
struct RangeRequest {
  enum class Kind {
    kWhole,         // no range of bytes, malformed, or several: the field is ignored, which RFC 9110 permits
    kPart,          // `range`
    kUnsatisfiable  // begins after the end: 416
  };
  Kind kind = Kind::kWhole;
  ByteRange range;
};
RangeRequest parse_range(std::string_view field, std::uint64_t size);

/// Whether an Accept-Encoding field lets `coding` ("gzip", "br") be sent; "*" names no coding here.
bool accepts_encoding(std::string_view field, std::string_view coding);
/// "ja" if an Accept-Language field prefers it to English, else "en".
std::string_view preferred_language(std::string_view field);
/// Whether an If-None-Match field names `entity_tag` ("\"abc\""), weakly compared, or is "*".
bool names_entity_tag(std::string_view field, std::string_view entity_tag);

}  // namespace kiroku::viewer

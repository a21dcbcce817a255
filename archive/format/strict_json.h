// Reading JSON that may have been made to mislead: two programs that read one line must see the same. Used
// for every line of a ledger and for excerpt.json. Values are plain data; functions are pure and thread-safe.
//
// Refused, each with the byte position: NUL and other control characters (also a carriage return or a tab
// between tokens), a byte order mark, invalid UTF-8, "\u0000", a key twice in one object, nesting deeper than
// allowed, more values than allowed, integers of magnitude 2^53 or more, fractions, exponents, NaN, null,
// trailing bytes, too long a text. (RFC 8259 allows much of it; RFC 7493, I-JSON, is the nearest profile.)
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "archive/format/limits.h"
#include "base/utc_time.h"
#include "crypto/hash.h"

namespace kiroku::archive {

/// Integers must be smaller in magnitude: above, programs that use doubles (jq 1.6, JavaScript) change them.
inline constexpr std::int64_t kJsonIntegerLimit = std::int64_t{1} << 53;

struct JsonLimits {
  std::size_t bytes = 1U << 20U;
  std::size_t depth = 4;  // the outermost object has depth 1
  std::size_t values = kMaximumJsonValues;
};

class JsonValue;
using JsonArray = std::vector<JsonValue>;
/// In the order written; keys are unique.
using JsonObject = std::vector<std::pair<std::string, JsonValue>>;

class JsonValue {
 public:
  using Content = std::variant<bool, std::int64_t, std::string, JsonArray, JsonObject>;
  explicit JsonValue(Content content) : content_(std::move(content)) {}
  [[nodiscard]] const Content& content() const { return content_; }
  [[nodiscard]] Content& content() { return content_; }
  bool operator==(const JsonValue& other) const = default;

 private:
  Content content_;
};

struct JsonParse {
  std::optional<JsonValue> value;
  std::size_t position = 0;  // byte at which it was refused
  std::string problem;       // "byte 17: the key \"seq\" stands twice"
};
JsonParse parse_json(std::string_view text, const JsonLimits& limits = {});

/// How many bytes the well-formed UTF-8 character at the beginning takes (Unicode table 3-7); 0 if there is
/// none.
std::size_t utf8_length(std::string_view text);

/// Takes the members of one object by name and type. The first thing wrong is written to `problem`, which
/// stays; after it, every accessor gives an empty value. So a caller reads all fields and asks once.
class JsonFields {
 public:
  /// `where` begins every sentence ("entry", "streams[2]"). `value` and `problem` must outlive the object.
  JsonFields(const JsonValue& value, std::string where, std::string& problem);

  [[nodiscard]] bool has(std::string_view key) const;
  std::string text(std::string_view key);
  std::vector<std::string> texts(std::string_view key);
  std::int64_t integer(std::string_view key);
  std::uint64_t count(std::string_view key);  // an integer that is not negative
  bool flag(std::string_view key);
  crypto::Sha256Digest digest(std::string_view key);  // 64 lower-case hex digits
  UtcTime utc(std::string_view key);                  // RFC 3339 with exactly six decimals and Z
  JsonFields object(std::string_view key);
  std::vector<JsonFields> objects(std::string_view key);
  /// Members whose names are free, each an object.
  std::vector<std::pair<std::string, JsonFields>> members();
  /// Every key not taken until now is unknown, which is a problem.
  void no_more();
  /// States a problem of the caller's own: "<where>: <key> <what>".
  void refuse(std::string_view key, std::string_view what);
  [[nodiscard]] bool failed() const { return !problem_->empty(); }

 private:
  const JsonValue* take(std::string_view key, std::size_t kind, std::string_view kind_name);

  const JsonObject* object_ = nullptr;
  std::vector<bool> taken_;
  std::string where_;
  std::string* problem_;
};

}  // namespace kiroku::archive

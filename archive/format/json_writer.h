// Writing one JSON object in one line with keys in the order given, as ledger lines are. What is written,
// strict_json reads back. Objects are not thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/utc_time.h"
#include "crypto/hash.h"

namespace kiroku::archive {

/// Collects the members of one object; nested objects are written by their own writer and added with json().
class JsonWriter {
 public:
  /// UTF-8 text. NUL and bytes that are not UTF-8 become U+FFFD: a cause or a reason is for people, and a
  /// strange byte in an error message must not stop a recording.
  JsonWriter& text(std::string_view key, std::string_view value);
  JsonWriter& texts(std::string_view key, const std::vector<std::string>& values);
  /// Throws kiroku::Error naming the key for a magnitude of 2^53 or more: not every reader can hold it.
  JsonWriter& integer(std::string_view key, std::int64_t value);
  JsonWriter& count(std::string_view key, std::uint64_t value);
  JsonWriter& flag(std::string_view key, bool value);
  JsonWriter& digest(std::string_view key, const crypto::Sha256Digest& value);  // lower-case hex
  JsonWriter& utc(std::string_view key, UtcTime value);
  /// `value` is JSON already.
  JsonWriter& json(std::string_view key, std::string_view value);
  /// The object, without line end.
  [[nodiscard]] std::string finish() const { return members_ + "}"; }

 private:
  void begin(std::string_view key);

  std::string members_ = "{";
};

/// `["a","b"]` of values that are JSON already.
std::string json_array(const std::vector<std::string>& values);

}  // namespace kiroku::archive

// The text of a policy of algorithms: as much of TOML 1.0 as a policy needs, and nothing else. Each line
// holds one `key = value`, a [[table]], a comment, or nothing; a value is a text, a whole number or a day.
// What is not so is refused by its place. Pure function, thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/utc_time.h"

namespace kiroku::evidence {

/// Where something stands in a file, from 1.
struct PolicyPlace {
  std::size_t line = 1, column = 1;
};

/// The day's beginning, in UTC.
struct PolicyDay {
  UtcTime begins;
};

struct PolicyValue {
  std::string key;
  PolicyPlace key_place, place;
  std::variant<std::string, std::int64_t, PolicyDay> value;
};

/// The keys of one table; each stands in it once.
struct PolicyTable {
  PolicyPlace place;
  std::vector<PolicyValue> values;
  /// Null where it has no such key.
  [[nodiscard]] const PolicyValue* find(std::string_view key) const;
};

struct PolicyText {
  PolicyTable top;
  std::vector<PolicyTable> algorithms;  // every [[algorithm]]
};

/// Throws kiroku::UsageError, "FILE:LINE:COLUMN: what is wrong; what to do".
PolicyText read_policy_text(std::string_view text, const std::string& file);
[[noreturn]] void refuse_policy(const std::string& file, const PolicyPlace& place,
                                const std::string& sentence);

}  // namespace kiroku::evidence

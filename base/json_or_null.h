// What lacks, as JSON says it: null. Header-only; for .cpp files, as the JSON library is slow to compile.
#pragma once

#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "base/utc_time.h"

namespace kiroku {

template <typename Value>
nlohmann::ordered_json or_null(const std::optional<Value>& value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
}

/// As RFC 3339.
inline nlohmann::ordered_json or_null(const std::optional<UtcTime>& time) {
  return time ? nlohmann::ordered_json(format_utc(*time)) : nlohmann::ordered_json(nullptr);
}

/// An empty text is none.
inline nlohmann::ordered_json or_null(const std::string& text) {
  return text.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(text);
}

}  // namespace kiroku

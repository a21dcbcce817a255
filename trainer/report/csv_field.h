// Text in a CSV file. Pure, thread-safe.
#pragma once

#include <string>

namespace kiroku::trainer {

/// As it is, or in quotes where it has to be (RFC 4180).
inline std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

}  // namespace kiroku::trainer

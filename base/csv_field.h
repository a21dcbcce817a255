// Text that somebody else wrote, as a field of a CSV file that people open in a spreadsheet. Pure,
// thread-safe.
#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "base/printable.h"

namespace kiroku {

/// On one line, with what would be obeyed or cannot be seen as printable() shows it. A spreadsheet takes a
/// text with certain beginnings for a formula and computes it: such a text begins with an apostrophe here.
/// In quotes where it has to be (RFC 4180).
inline std::string csv_field(std::string_view text) {
  // Those of full width are read as the others, where the spreadsheet speaks Japanese.
  constexpr std::array<std::string_view, 8> kOfFormulas{"=", "+", "-", "@", "＝", "＋", "－", "＠"};
  std::string field = printable(text);
  const bool is_formula = std::ranges::any_of(
      kOfFormulas, [&](std::string_view beginning) { return field.starts_with(beginning); });
  if (is_formula) field.insert(0, 1, '\'');
  if (field.find_first_of(",\"") == std::string::npos) return field;
  std::string quoted = "\"";
  for (const char c : field) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

}  // namespace kiroku

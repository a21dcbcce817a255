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
/// text with certain beginnings for a formula and computes it: such a text begins with an apostrophe here,
/// and so does what follows a semicolon, where many countries' spreadsheets begin the next cell. In quotes
/// where it has to be (RFC 4180).
inline std::string csv_field(std::string_view text) {
  // Those of full width are read as the others, where the spreadsheet speaks Japanese.
  constexpr std::array<std::string_view, 8> kOfFormulas{"=", "+", "-", "@", "＝", "＋", "－", "＠"};
  const std::string shown = printable(text);
  std::string field;
  bool may_begin = true;
  for (std::size_t at = 0; at < shown.size(); ++at) {
    const std::string_view rest = std::string_view(shown).substr(at);
    if (may_begin && std::ranges::any_of(kOfFormulas, [&](std::string_view beginning) {
          return rest.starts_with(beginning);
        }))
      field += '\'';
    field += shown[at];
    may_begin = shown[at] == ';';
  }
  if (field.find_first_of(",\"") == std::string::npos) return field;
  std::string quoted = "\"";
  for (const char c : field) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

}  // namespace kiroku

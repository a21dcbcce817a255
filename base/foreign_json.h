// JSON that somebody else wrote. Header-only; for .cpp files, as the JSON library is slow to compile. Pure
// functions, thread-safe.
#pragma once

#include <cstddef>
#include <string_view>

#include <nlohmann/json.hpp>

namespace kiroku {

/// Deeper than anything that this project writes or asks for.
inline constexpr std::size_t kMostJsonNesting = 64;

/// Whether arrays and objects of `text` lie in each other more than kMostJsonNesting deep. Of text that is no
/// JSON it may say either.
inline bool nests_too_deep(std::string_view text) {
  std::size_t depth = 0;
  bool is_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (is_string) {
      if (c == '\\') ++i;
      is_string = c != '"';
    } else if (c == '"') {
      is_string = true;
    } else if (c == '[' || c == '{') {
      if (++depth > kMostJsonNesting) return true;
    } else if ((c == ']' || c == '}') && depth > 0) {
      --depth;
    }
  }
  return false;
}

/// The value, discarded (is_discarded(), and of no type) where `text` is no JSON or nests too deep: the
/// library copies, compares and writes a value by recursion, so that a few kilobytes of brackets would end
/// the process for want of stack.
template <typename Json = nlohmann::json>
Json parse_foreign_json(std::string_view text) {
  if (nests_too_deep(text)) return Json(nlohmann::detail::value_t::discarded);
  return Json::parse(text, nullptr, false);
}

}  // namespace kiroku

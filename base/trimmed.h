// A text without what pads it. Header-only; thread-safe.
#pragma once

#include <string_view>

namespace kiroku {

/// Without these characters at its beginning and end; a view of the same text.
constexpr std::string_view trimmed(std::string_view text, std::string_view padding = " \t\r\n") {
  const std::size_t begin = text.find_first_not_of(padding);
  return begin == std::string_view::npos ? std::string_view()
                                         : text.substr(begin, text.find_last_not_of(padding) + 1 - begin);
}

}  // namespace kiroku

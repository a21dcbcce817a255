// Names in one line of text. Pure, thread-safe.
#pragma once

#include <string>
#include <string_view>

namespace kiroku {

/// "endoscope, room, vitals" of a range of texts.
template <typename Texts>
std::string joined(const Texts& texts, std::string_view separator = ", ") {
  std::string line;
  for (const auto& text : texts) {
    if (!line.empty()) line += separator;
    line += text;
  }
  return line;
}

}  // namespace kiroku

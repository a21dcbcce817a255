#include "viewer/report/document.h"

#include <array>

#include "crypto/utf8.h"

namespace kiroku::report {
namespace {

constexpr std::string_view kReplacement = "\xEF\xBF\xBD";  // U+FFFD

/// Bytes of the character that `text` begins with; 1 where there is none.
std::size_t character_bytes(std::string_view text) {
  constexpr std::size_t kLongest = 4;
  for (std::size_t size = 1; size <= kLongest && size <= text.size(); ++size) {
    if (crypto::is_utf8(text.substr(0, size))) return size;
  }
  return 1;
}

bool misleads(std::string_view character) {
  // U+0080 to U+009F, the marks and embeddings of direction, line and paragraph separators, the byte order
  // mark.
  static constexpr auto kHidden = std::to_array<std::string_view>(
      {"\u200B", "\u200E", "\u200F", "\u2028", "\u2029", "\u202A", "\u202B", "\u202C", "\u202D", "\u202E",
       "\u2066", "\u2067", "\u2068", "\u2069", "\uFEFF"});
  if (character.size() == 1) {
    const auto code = static_cast<unsigned char>(character[0]);
    return code < 0x20 || code >= 0x7F;
  }
  if (character.size() == 2 && character[0] == '\xC2') return static_cast<unsigned char>(character[1]) < 0xA0;
  for (const std::string_view hidden : kHidden) {
    if (character == hidden) return true;
  }
  return false;
}

}  // namespace

std::string_view symbol_of(Tone tone) {
  switch (tone) {
    case Tone::kGood:
      return "✓";
    case Tone::kCaution:
      return "!";
    case Tone::kBad:
      return "✗";
    case Tone::kPlain:
      break;
  }
  return "";
}

std::string plain_text(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const std::size_t size = character_bytes(text);
    const std::string_view character = text.substr(0, size);
    if (character == "\n" || character == "\t") {
      out += ' ';
    } else if (misleads(character)) {
      out += kReplacement;
    } else {
      out += character;
    }
    text.remove_prefix(size);
  }
  return out;
}

}  // namespace kiroku::report

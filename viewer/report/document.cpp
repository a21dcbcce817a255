#include "viewer/report/document.h"

#include "base/printable.h"

namespace kiroku::report {

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

std::string plain_text(std::string_view text, std::size_t most) {
  if (text.size() <= most) return printable(text);
  std::size_t end = most;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U)
    --end;  // not within a character
  return printable(text.substr(0, end)) + "…";
}

std::string shell_word(std::string_view text) {
  std::string word("'");
  for (const char each : plain_text(text)) word += each == '\'' ? std::string("'\\''") : std::string(1, each);
  return word + "'";
}

}  // namespace kiroku::report

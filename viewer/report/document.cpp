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

std::string plain_text(std::string_view text) { return printable(text); }

}  // namespace kiroku::report

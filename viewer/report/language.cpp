#include "viewer/report/language.h"

#include <string>

#include "base/error.h"

namespace kiroku::report {

std::string_view language_tag(Language language) { return language == Language::kEnglish ? "en" : "ja"; }

Language parse_language(std::string_view tag) {
  for (const Language language : {Language::kEnglish, Language::kJapanese}) {
    if (language_tag(language) == tag) return language;
  }
  throw UsageError("there are no texts in the language '" + std::string(tag) + "': ask for 'en' or 'ja'");
}

}  // namespace kiroku::report

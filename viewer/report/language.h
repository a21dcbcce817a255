// The languages that documents are written in.
#pragma once

#include <cstdint>
#include <string_view>

namespace kiroku::report {

enum class Language : std::uint8_t { kEnglish, kJapanese };
/// "en", "ja" (RFC 5646).
std::string_view language_tag(Language language);
/// Throws kiroku::UsageError for any other tag.
Language parse_language(std::string_view tag);

}  // namespace kiroku::report

// UTF-8 (RFC 3629), as far as signed notes need it. Pure functions, thread-safe.
#pragma once

#include <string_view>

namespace kiroku::crypto {

/// Whether every sequence is well formed: shortest form, no surrogates, nothing above U+10FFFF.
bool is_utf8(std::string_view text);
/// Whether one of the characters has the Unicode property White_Space. `text` must be UTF-8.
bool has_unicode_space(std::string_view text);

}  // namespace kiroku::crypto

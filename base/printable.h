// Text that somebody else wrote, before a person sees it. Some characters are obeyed instead of shown:
// controls move a terminal's cursor, marks of writing direction turn the rest of a line round, others take no
// room at all, so that two names look the same. Pure functions, thread-safe.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace kiroku {

/// Whether a character is obeyed, or cannot be seen: C0, DEL and C1 (Unicode category Cc), marks and
/// overrides of direction, line and paragraph separators, zero-width characters, invisible fillers, tags,
/// noncharacters, a braille pattern without a dot. Letters of any script and combining accents are not among
/// them. Nor are variation selectors, which Japanese names need; the functions below take one for such a
/// character where it does not stand behind an ideograph or a sign.
bool misleads(char32_t character);

/// Fit for one line of a terminal, a report or a journal: a line feed or tab becomes a space, a character
/// that misleads becomes "\u{202E}" (hexadecimal, as in Unicode's own examples), a byte that is no UTF-8
/// "\x{FF}". All else stays.
std::string printable(std::string_view text);

/// Text within quotation marks of any kind: its own become "\\u{201D}", so that it cannot seem to end where
/// it goes on. printable() is for all else that misleads.
std::string without_quotation_marks(std::string_view text);
/// The same within '"', which are added. Corner brackets stay: they end nothing there.
std::string in_quotation_marks(std::string_view text);

/// JSON text with the same characters as \u escapes, which say the same to every reader. For JSON that is
/// well-formed UTF-8; what stands outside strings has none of them but white space.
std::string printable_json(std::string_view json);

/// How printable() writes the first character of `text` that may not stand in a name, a reason or a mark: one
/// that misleads, a line feed, a tab, a byte that is no UTF-8. Nothing where there is none.
std::optional<std::string> first_unprintable(std::string_view text);

/// Throws kiroku::UsageError, naming the character, unless `text` has none. `what` begins the sentence: "the
/// guest's name".
void require_printable(std::string_view text, const std::string& what);

}  // namespace kiroku

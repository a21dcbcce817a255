#include "base/printable.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <utility>

#include "base/error.h"

namespace kiroku {
namespace {

struct Range {
  char32_t first, last;
};
// In rising order.
constexpr std::array kMisleading{
    Range{0x0000, 0x001f},    // C0
    Range{0x007f, 0x009f},    // DEL, C1
    Range{0x00ad, 0x00ad},    // soft hyphen
    Range{0x034f, 0x034f},    // combining grapheme joiner
    Range{0x061c, 0x061c},    // Arabic letter mark
    Range{0x115f, 0x1160},    // Hangul fillers
    Range{0x17b4, 0x17b5},    // Khmer inherent vowels
    Range{0x180e, 0x180e},    // Mongolian vowel separator
    Range{0x200b, 0x200f},    // zero-width space and joiners, marks of direction
    Range{0x2028, 0x202e},    // line and paragraph separators, embeddings and overrides
    Range{0x2060, 0x206f},    // word joiner, invisible operators, isolates, deprecated formats
    Range{0x2800, 0x2800},    // a braille pattern without a dot
    Range{0x3164, 0x3164},    // Hangul filler
    Range{0xd800, 0xdfff},    // surrogates
    Range{0xfdd0, 0xfdef},    // noncharacters
    Range{0xfeff, 0xfeff},    // byte order mark
    Range{0xffa0, 0xffa0},    // halfwidth Hangul filler
    Range{0xfff0, 0xfffc},    // interlinear annotations, object replacement
    Range{0x1bca0, 0x1bca3},  // shorthand formats
    Range{0x1d173, 0x1d17a},  // musical formats
    Range{0xe0000, 0xe00ff},  // tags
};

struct Character {
  std::optional<char32_t> value;  // nothing: a byte that is no UTF-8
  std::string_view bytes;
};

/// The character that `text`, which is not empty, begins with (RFC 3629).
Character first_of(std::string_view text) {
  const auto byte = [&](std::size_t at) { return static_cast<std::uint8_t>(text[at]); };
  const Character malformed{std::nullopt, text.substr(0, 1)};
  const std::uint8_t lead = byte(0);
  if (lead < 0x80) return {lead, text.substr(0, 1)};
  const std::size_t size = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  if (lead < 0xc2 || lead > 0xf4 || text.size() < size) return malformed;
  char32_t value = lead & (0xffU >> (size + 1));
  for (std::size_t at = 1; at < size; ++at) {
    if ((byte(at) & 0xc0U) != 0x80) return malformed;
    value = value << 6U | (byte(at) & 0x3fU);
  }
  constexpr std::array<char32_t, 5> kSmallest{0, 0, 0x80, 0x800, 0x10000};
  if (value < kSmallest.at(size) || value > 0x10ffff || (value >= 0xd800 && value <= 0xdfff))
    return malformed;
  return {value, text.substr(0, size)};
}

std::string escape(const char* form, unsigned value) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), form, value);
  return text.data();
}

std::string visible(const Character& character) {
  return character.value ? escape("\\u{%04X}", static_cast<unsigned>(*character.value))
                         : escape("\\x{%02X}", static_cast<std::uint8_t>(character.bytes[0]));
}

// Of which a selector shows a variant: signs that are drawn as a picture or as a letter.
constexpr std::array kSigns{
    Range{0x00a9, 0x00a9}, Range{0x00ae, 0x00ae},   Range{0x203c, 0x203c}, Range{0x2049, 0x2049},
    Range{0x2100, 0x27ff}, Range{0x2801, 0x2bff},   Range{0x3030, 0x3030}, Range{0x303d, 0x303d},
    Range{0x3297, 0x3299}, Range{0x1f000, 0x1faff},
};
// Likewise: ideographs, as Japanese names have them.
constexpr std::array kIdeographs{
    Range{0x3005, 0x3007},
    Range{0x3400, 0x9fff},
    Range{0xf900, 0xfaff},
    Range{0x20000, 0x3fffd},
};

template <std::size_t kSize>
bool is_in(const std::array<Range, kSize>& ranges, char32_t character) {
  const auto* range = std::ranges::lower_bound(ranges, character, {}, &Range::last);
  return range != ranges.end() && range->first <= character;
}

bool is_ideographic_selector(char32_t character) { return character >= 0xe0100 && character <= 0xe01ef; }
bool is_selector(char32_t character) {
  return (character >= 0xfe00 && character <= 0xfe0f) || is_ideographic_selector(character);
}

/// Behind `before`, 0 at the beginning: a selector of a variant is seen behind what has variants alone.
bool misleads_behind(char32_t before, char32_t character) {
  if (!is_selector(character)) return misleads(character);
  return !is_in(kIdeographs, before) && (is_ideographic_selector(character) || !is_in(kSigns, before));
}

}  // namespace

bool misleads(char32_t character) {
  if ((character & 0xfffeU) == 0xfffe) return true;  // the last two of each plane are no characters
  return is_in(kMisleading, character);
}

std::string printable(std::string_view text) {
  std::string out;
  char32_t before = 0;
  while (!text.empty()) {
    const Character character = first_of(text);
    if (character.value == U'\n' || character.value == U'\t') {
      out += ' ';
    } else if (!character.value || misleads_behind(before, *character.value)) {
      out += visible(character);
    } else {
      out += character.bytes;
    }
    before = character.value.value_or(0);
    text.remove_prefix(character.bytes.size());
  }
  return out;
}

namespace {

// What ends a quotation, or looks like that.
constexpr std::array kQuotationMarks{
    Range{0x0022, 0x0022}, Range{0x00ab, 0x00ab}, Range{0x00bb, 0x00bb}, Range{0x02ba, 0x02ba},
    Range{0x02dd, 0x02dd}, Range{0x02ee, 0x02ee}, Range{0x201c, 0x201f}, Range{0x2033, 0x2034},
    Range{0x2036, 0x2037}, Range{0x275d, 0x275e}, Range{0x301d, 0x301f}, Range{0xff02, 0xff02},
};
constexpr std::array kCornerBrackets{Range{0x300c, 0x300f}, Range{0xfe41, 0xfe44}, Range{0xff62, 0xff63}};

std::string escaped_if(std::string_view text, bool (*is_mark)(char32_t)) {
  std::string out;
  while (!text.empty()) {
    const Character character = first_of(text);
    out += character.value && is_mark(*character.value) ? visible(character) : std::string(character.bytes);
    text.remove_prefix(character.bytes.size());
  }
  return out;
}

}  // namespace

std::string without_quotation_marks(std::string_view text) {
  return escaped_if(
      text, [](char32_t each) { return is_in(kQuotationMarks, each) || is_in(kCornerBrackets, each); });
}

std::string in_quotation_marks(std::string_view text) {
  return '"' + escaped_if(text, [](char32_t each) { return is_in(kQuotationMarks, each); }) + '"';
}

std::string printable_json(std::string_view json) {
  std::string out;
  char32_t before = 0;
  while (!json.empty()) {
    const Character character = first_of(json);
    const char32_t value = character.value.value_or(0);
    // White space between tokens is below U+0020; within strings JSON has none of these.
    if (value < 0x20 || !misleads_behind(std::exchange(before, value), value)) {
      out += character.bytes;
    } else if (value < 0x10000) {
      out += escape("\\u%04x", static_cast<unsigned>(value));
    } else {
      const auto above = static_cast<unsigned>(value - 0x10000);
      out += escape("\\u%04x", 0xd800 + (above >> 10U)) + escape("\\u%04x", 0xdc00 + (above & 0x3ffU));
    }
    json.remove_prefix(character.bytes.size());
  }
  return out;
}

std::optional<std::string> first_unprintable(std::string_view text) {
  char32_t before = 0;
  while (!text.empty()) {
    const Character character = first_of(text);
    if (!character.value || misleads_behind(std::exchange(before, *character.value), *character.value))
      return visible(character);
    text.remove_prefix(character.bytes.size());
  }
  return std::nullopt;
}

void require_printable(std::string_view text, const std::string& what) {
  if (const std::optional<std::string> character = first_unprintable(text)) {
    throw UsageError(what + " holds " + *character +
                     ", which is obeyed or cannot be seen where it is shown: write it without");
  }
}

}  // namespace kiroku

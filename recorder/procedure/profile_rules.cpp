#include "recorder/procedure/profile_rules.h"

#include <algorithm>
#include <glib.h>
#include <memory>

#include <nlohmann/json.hpp>

#include "base/foreign_json.h"

namespace kiroku::recorder {
namespace {

using GlibText = std::unique_ptr<char, decltype(&g_free)>;

/// From here on scripts are written without blanks between words (CJK radicals, kana, ideographs).
constexpr gunichar kFirstWithoutBlanks = 0x2e80;

std::string taken(char* text) {
  const GlibText owned(text, &g_free);
  return owned ? std::string(owned.get()) : std::string();
}

/// For comparing; each blank one space, none at the ends.
std::string folded(std::string_view text) {
  // What is no UTF-8 has U+FFFD in its place.
  const std::string valid = taken(g_utf8_make_valid(text.data(), static_cast<gssize>(text.size())));
  const std::string wide =
      taken(g_utf8_normalize(valid.data(), static_cast<gssize>(valid.size()), G_NORMALIZE_ALL_COMPOSE));
  const std::string whole = taken(g_utf8_casefold(wide.data(), static_cast<gssize>(wide.size())));
  std::string out;
  for (const char c : whole) {
    const bool blank = c == ' ' || c == '\t' || c == '\n' || c == '\r';
    if (!blank) {
      out += c;
    } else if (!out.empty() && out.back() != ' ') {
      out += ' ';
    }
  }
  if (!out.empty() && out.back() == ' ') out.pop_back();
  return out;
}

bool belongs_to_words(gunichar letter) {
  return letter < kFirstWithoutBlanks && (g_unichar_isalnum(letter) != 0 || g_unichar_ismark(letter) != 0);
}

/// The letter that begins at, or ends before, `at`; 0 where there is none.
gunichar letter_at(const std::string& text, std::size_t at) {
  return at < text.size() ? g_utf8_get_char(text.data() + at) : 0;
}
gunichar letter_before(const std::string& text, std::size_t at) {
  const char* before = at == 0 ? nullptr : g_utf8_find_prev_char(text.data(), text.data() + at);
  return before == nullptr ? 0 : g_utf8_get_char(before);
}

bool stands_alone(const std::string& text, std::size_t at, const std::string& word) {
  const bool joined_before =
      belongs_to_words(letter_at(word, 0)) && belongs_to_words(letter_before(text, at));
  const bool joined_after = belongs_to_words(letter_before(word, word.size())) &&
                            belongs_to_words(letter_at(text, at + word.size()));
  return !joined_before && !joined_after;
}

std::string text_of(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

}  // namespace

bool has_word(std::string_view text, std::string_view word) {
  const std::string where = folded(text), what = folded(word);
  if (what.empty()) return false;
  for (std::size_t at = where.find(what); at != std::string::npos; at = where.find(what, at + 1)) {
    if (stands_alone(where, at, what)) return true;
  }
  return false;
}

std::optional<ProfileChoice> choose_profile(const std::vector<ProfileRule>& rules, const Bytes& subject) {
  const nlohmann::json stated = parse_foreign_json(kiroku::text_of(subject));
  if (!stated.is_object()) return {};
  const auto found = stated.find("procedure");
  if (found == stated.end()) return {};
  std::string description, code;
  if (found->is_string()) {
    description = found->get<std::string>();
  } else if (found->is_object()) {
    description = text_of(*found, "description");
    code = text_of(*found, "code");
  }
  const std::string folded_code = folded(code);
  for (const ProfileRule& rule : rules) {
    for (const std::string& each : rule.codes) {
      if (!folded_code.empty() && folded(each) == folded_code)
        return ProfileChoice{rule, "the code '" + each + "' of the procedure"};
    }
    for (const std::string& word : rule.words) {
      if (has_word(description, word))
        return ProfileChoice{rule, "the word '" + word + "' in '" + description + "'"};
    }
  }
  return {};
}

}  // namespace kiroku::recorder

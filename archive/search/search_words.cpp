#include "archive/search/search_words.h"

#include <algorithm>
#include <glib.h>
#include <memory>

#include <nlohmann/json.hpp>

#include "base/foreign_json.h"

namespace kiroku::search {
namespace {

using GlibText = std::unique_ptr<char, decltype(&g_free)>;

constexpr gunichar kMinusSign = 0x2212;

std::string normalised(std::string_view text) {
  const GlibText form(
      g_utf8_normalize(text.data(), static_cast<gssize>(text.size()), G_NORMALIZE_ALL_COMPOSE), &g_free);
  return form ? std::string(form.get()) : std::string();
}

std::string case_folded(std::string_view text) {
  const GlibText folded(g_utf8_casefold(text.data(), static_cast<gssize>(text.size())), &g_free);
  return folded.get();
}

bool is_left_out(gunichar letter) {
  const GUnicodeType type = g_unichar_type(letter);
  return g_unichar_isspace(letter) != 0 || type == G_UNICODE_CONTROL || type == G_UNICODE_FORMAT ||
         type == G_UNICODE_SPACE_SEPARATOR || type == G_UNICODE_LINE_SEPARATOR ||
         type == G_UNICODE_PARAGRAPH_SEPARATOR;
}

std::string text_at(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end()) return "";
  // Who writes a subject by hand may write a number as a number.
  return found->is_string() ? found->get<std::string>() : found->is_number_integer() ? found->dump() : "";
}

}  // namespace

std::string normal_word(std::string_view text) {
  if (text.size() > kLongestWord ||
      g_utf8_validate(text.data(), static_cast<gssize>(text.size()), nullptr) == 0)
    return "";
  // Folding may leave letters that are composed otherwise.
  const std::string folded = normalised(case_folded(normalised(text)));
  std::string word;
  const char* next = nullptr;
  for (const char* at = folded.c_str(); *at != '\0'; at = next) {
    next = g_utf8_next_char(at);
    const gunichar letter = g_utf8_get_char(at);
    if (is_left_out(letter)) continue;
    if (g_unichar_type(letter) == G_UNICODE_DASH_PUNCTUATION || letter == kMinusSign) {
      word += '-';
    } else {
      word.append(at, static_cast<std::size_t>(next - at));
    }
  }
  return word;
}

std::string normal_number(std::string_view text) {
  std::string word = normal_word(text);
  if (word.find_first_not_of("0123456789") == std::string::npos)
    word.erase(0, std::min(word.find_first_not_of('0'), word.size()));
  return word;
}

SearchWords words_of_subject(ByteView subject) {
  const auto stated = parse_foreign_json<nlohmann::json>(text_of(subject));
  if (!stated.is_object()) return {};
  SearchWords words;
  if (const auto patient = stated.find("patient"); patient != stated.end() && patient->is_object()) {
    words.patient = normal_number(text_at(*patient, "id"));
    if (!words.patient.empty()) words.authority = normal_word(text_at(*patient, "id_issuer"));
  }
  if (const auto procedure = stated.find("procedure"); procedure != stated.end() && procedure->is_object()) {
    words.code = normal_word(text_at(*procedure, "code"));
    if (!words.code.empty()) words.system = normal_word(text_at(*procedure, "coding_system"));
  }
  return words;
}

}  // namespace kiroku::search

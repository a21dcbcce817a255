#include "viewer/report/texts.h"

namespace kiroku::report {

std::string say(Language language, TextKey key, std::initializer_list<std::string> values) {
  std::string_view text = language == Language::kEnglish ? key.text().english : key.text().japanese;
  std::string out;
  while (!text.empty()) {
    if (text.size() >= 3 && text[0] == '{' && text[2] == '}') {
      out += std::data(values)[text[1] - '0'];
      text.remove_prefix(3);
    } else {
      out += text[0];
      text.remove_prefix(1);
    }
  }
  return out;
}

std::string say_count(Language language, std::uint64_t number, TextKey one, TextKey many) {
  return say(language, number == 1 ? one : many, {std::to_string(number)});
}

}  // namespace kiroku::report

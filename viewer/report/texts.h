// Every sentence of the documents, in every language: the one dictionary. Pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>

#include "viewer/report/language.h"
#include "viewer/report/text_table.h"

namespace kiroku::report {

/// A key of the dictionary; any other does not compile.
class TextKey {
 public:
  // NOLINTNEXTLINE(google-explicit-constructor,hicpp-explicit-conversions): so that a literal is checked
  // where it stands
  consteval TextKey(const char* key) : index_(find(key)) {}
  [[nodiscard]] constexpr const Text& text() const { return kTexts[index_]; }

 private:
  static consteval std::size_t find(std::string_view key) {
    std::size_t index = 0;
    while (kTexts.at(index).key != key) {
      ++index;  // at() ends the compilation for a key that is not in the table
    }
    return index;
  }

  std::size_t index_;
};

/// The text with its values in place.
std::string say(Language language, TextKey key, std::initializer_list<std::string> values = {});
/// "1 file", "12 files"; Japanese knows one form.
std::string say_count(Language language, std::uint64_t number, TextKey one, TextKey many);

}  // namespace kiroku::report

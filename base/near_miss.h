// What somebody may have meant who mistyped a word. Pure functions, thread-safe.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace kiroku {

/// The known word that is nearest to what was typed, by insertions, deletions, exchanges and swaps of
/// neighbours (optimal string alignment distance; Damerau, doi 10.1145/363958.363994), letters' case left
/// aside; the first of several. Nothing where none is near: more than a third of the longer word would have
/// to change. A word of which the other is the beginning (3 letters or more) is near.
std::optional<std::string> nearest_word(std::string_view typed, const std::vector<std::string>& known);

/// " (did you mean 'record'?)", to be put behind the sentence's part that names the word; or nothing.
std::string did_you_mean(std::string_view typed, const std::vector<std::string>& known);

}  // namespace kiroku

#include "base/near_miss.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "base/ascii.h"

namespace kiroku {
namespace {

// Longer words are not typed by hand, and comparing them would take time for nothing.
constexpr std::size_t kLongestWord = 64;
constexpr std::size_t kShortestBeginning = 3;

std::size_t distance(std::string_view a, std::string_view b) {
  std::array<std::vector<std::size_t>, 3> rows;  // of a's letters before the last two, before the last, now
  for (auto& row : rows) row.resize(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) rows[2][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::rotate(rows.begin(), rows.begin() + 1, rows.end());
    rows[2][0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t exchange = rows[1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      rows[2][j] = std::min({rows[1][j] + 1, rows[2][j - 1] + 1, exchange});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        rows[2][j] = std::min(rows[2][j], rows[0][j - 2] + 1);
      }
    }
  }
  return rows[2][b.size()];
}

}  // namespace

std::optional<std::string> nearest_word(std::string_view typed, const std::vector<std::string>& known) {
  if (typed.empty() || typed.size() > kLongestWord) return std::nullopt;
  const std::string asked = lower_case(typed);
  std::optional<std::string> best;
  std::size_t best_distance = 0;
  for (const std::string& word : known) {
    if (word.size() > kLongestWord) continue;
    const std::string offered = lower_case(word);
    const std::size_t shorter = std::min(asked.size(), offered.size());
    const bool begins =
        shorter >= kShortestBeginning && asked.substr(0, shorter) == offered.substr(0, shorter);
    const std::size_t allowed = std::max<std::size_t>(1, std::max(asked.size(), offered.size()) / 3);
    // A beginning is as good as the farthest word that is still near.
    const std::size_t changes = distance(asked, offered);
    const std::size_t rated = begins ? std::min(changes, allowed) : changes;
    // One letter for another tells nothing about a word of one letter.
    if (rated > allowed || changes >= std::max(asked.size(), offered.size())) continue;
    if (!best || rated < best_distance) {
      best = word;
      best_distance = rated;
    }
  }
  return best;
}

std::string did_you_mean(std::string_view typed, const std::vector<std::string>& known) {
  const auto word = nearest_word(typed, known);
  return word ? " (did you mean '" + *word + "'?)" : "";
}

}  // namespace kiroku

#include "apps/train/attempt_numbers.h"

#include "base/number_text.h"

namespace kiroku::apps {

std::string vitals_lines(const trainer::ExclusionView& view) {
  std::string lines;
  const std::string time = std::to_string(view.time_s);  // never with an exponent
  const auto add = [&](const std::string& code, double value, const std::string& unit) {
    lines += time + "," + code + "," + number_text(value) + "," + unit + "\n";
  };
  add("line in sight", 100 * view.visible_share, "%");
  add("largest stress", view.largest_von_mises_pa / 1e3, "kPa");
  const bool instruments = !view.hand.instruments.empty();
  add(instruments ? "force of all handles" : "force of all fingers", view.hand.wrist_n.norm(), "N");
  for (std::size_t i = 0; i < view.hand.forces_n.size(); ++i) {
    add((instruments ? "force of instrument " : "force of finger ") + std::to_string(i + 1),
        view.hand.forces_n[i].norm(), "N");
  }
  return lines;
}

std::string in_words(const trainer::ExclusionScore& score) {
  return std::string(score.done ? "the line was seen for a second after "
                                : "the line was not seen for a second within ") +
         number_text(score.time_s, 3) + " s (at best " + number_text(100 * score.best_visible_share, 3) +
         " % of it)";
}

}  // namespace kiroku::apps

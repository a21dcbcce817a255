#include "trainer/report/score_json.h"

#include <nlohmann/json.hpp>

namespace kiroku::trainer {

nlohmann::ordered_json score_json(const ExclusionScore& score) {
  return {{"done", score.done},
          {"time_s", score.time_s},
          {"largest_von_mises_pa", score.largest_von_mises_pa},
          {"high_von_mises_pa", score.high_von_mises_pa ? nlohmann::ordered_json(*score.high_von_mises_pa)
                                                        : nlohmann::ordered_json(nullptr)},
          {"damaged_ml", 1e6 * score.damaged_m3},
          {"path_m", score.path_m},
          {"peak_force_n", score.peak_force_n},
          {"peak_wrist_force_n", score.peak_wrist_n},
          {"best_visible_share", score.best_visible_share}};
}

}  // namespace kiroku::trainer

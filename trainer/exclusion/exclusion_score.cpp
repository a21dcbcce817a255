#include "trainer/exclusion/exclusion_score.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

constexpr std::array<const char*, 4> kEndingNames{"done", "time-over", "given-up", "broken-off"};

}  // namespace

std::string name_of(Ending ending) { return kEndingNames.at(static_cast<std::size_t>(ending)); }

Ending ending_named(const std::string& name) {
  const auto* const found = std::ranges::find(kEndingNames, name);
  if (found == kEndingNames.end()) throw UsageError("'" + name + "' is no way in which an attempt ends");
  return static_cast<Ending>(found - kEndingNames.begin());
}

void ExclusionJudge::see(const ExclusionMoment& moment) {
  if (over_) return;
  score_.time_s = moment.time_s;
  score_.best_visible_share = std::max(score_.best_visible_share, moment.visible_share);
  score_.largest_von_mises_pa = std::max(score_.largest_von_mises_pa, moment.largest_von_mises_pa);
  score_.damaged_m3 = std::max(score_.damaged_m3, moment.damaged_m3);
  score_.high_von_mises_pa = std::max(score_.high_von_mises_pa.value_or(0), moment.high_von_mises_pa);
  if (moment.visible_share < task_.visible_share) {
    seen_ = false;
    held_s_ = 0;
  } else if (!seen_) {
    seen_ = true;
    seen_since_s_ = moment.time_s;
  } else {
    held_s_ = moment.time_s - seen_since_s_;
  }
  // Times are sums of periods: what is missing by their rounding is not missing.
  constexpr double kRoundingSeconds = 1e-9;
  score_.done = seen_ && held_s_ >= task_.hold_s - kRoundingSeconds;
  over_ = score_.done || moment.time_s >= task_.most_s - kRoundingSeconds;
}

double danger(double von_mises_pa, double damage_pa) {
  return std::clamp(2 * von_mises_pa / damage_pa - 1, 0.0, 1.0);
}

double danger_tone_hz(double danger) {
  constexpr double kLowest = 220, kOctaves = 2;
  return danger > 0 ? kLowest * std::exp2(kOctaves * danger) : 0;
}

}  // namespace kiroku::trainer

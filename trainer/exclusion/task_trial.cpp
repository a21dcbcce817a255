#include "trainer/exclusion/task_trial.h"

#include <algorithm>
#include <cmath>

#include "base/number_text.h"
#include "trainer/exclusion/simulated_trainee.h"

namespace kiroku::trainer {
namespace {

/// As long as the simulated trainee needs for most of its places.
constexpr double kMostSeconds = 60;
constexpr std::uint32_t kSeed = 1;
/// Of a finger: more than a person presses with for long. What it takes more for is not taken for seen.
constexpr double kMostNewtons = 40;

/// Coarse, as it is only to be told whether the line comes into sight.
ExclusionOptions trial_options(const ExclusionTask& task) {
  ExclusionOptions options;
  options.force_rate_hz = 500;
  options.picture_rate_hz = 10;
  options.width = 320;
  options.height = 240;
  options.most_s = std::min(task.most_s, kMostSeconds);
  return options;
}

/// "5", "5 and 3", "5, 3 and 1".
std::string listed(std::span<const std::size_t> numbers) {
  std::string text;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (i > 0) text += i + 1 == numbers.size() ? " and " : ", ";
    text += std::to_string(numbers[i]);
  }
  return text;
}

}  // namespace

std::string doubt_about(const ExclusionBody& body, std::span<const std::size_t> fingers) {
  const ExclusionTask& task = body.task();
  const ExclusionOptions options = trial_options(task);
  double best = 0;
  for (const std::size_t count : fingers) {
    ExclusionRunner runner(body, options);
    SimulatedTrainee trainee(body, unpractised_plan(count, kSeed), 1 / options.force_rate_hz);
    ExclusionJudge judge(task);
    (void)runner.run_in_own_time(trainee, [&](const ExclusionView& view) {
      trainee.see(view, false);
      judge.see({view.time_s, any_above(kMostNewtons, view.hand.forces_n) ? 0 : view.visible_share, 0, 0});
      return true;
    });
    if (judge.score().done) return "";
    best = std::max(best, judge.score().best_visible_share);
  }
  return "perhaps nobody can bring the line behind " + body.object().name +
         " into sight: a simulated trainee tried with " + listed(fingers) +
         (fingers.size() == 1 && fingers[0] == 1 ? " finger" : " fingers") + " and saw " +
         number_text(std::floor(100 * best), 3) + " % of it at best with no finger pressing by more than " +
         number_text(kMostNewtons, 3) + " N, where " + number_text(std::round(100 * task.visible_share), 3) +
         " % are to stay in sight for " + number_text(task.hold_s, 3) +
         " s; have less of the organ held, raise the friction, or give the line another place";
}

}  // namespace kiroku::trainer

#include "trainer/curriculum/simulated_study.h"

#include "base/error.h"
#include "trainer/exclusion/simulated_trainee.h"

namespace kiroku::trainer {

std::vector<ExclusionRecord> run_simulated_study(const ExclusionBody& body, const SimulatedStudy& study,
                                                 const std::function<void(const ExclusionRecord&)>& made) {
  if (study.trainees_a_group < 1 || study.sessions < 1)
    throw UsageError("a study needs at least one trainee in each group and one session");
  // Coarse enough to be quick, fine enough for a model: hands are steered by pictures of a tenth of a second.
  ExclusionOptions options;
  options.force_rate_hz = 200;
  options.picture_rate_hz = 10;
  options.width = 160;
  options.height = 120;
  ExclusionRunner runner(body, options);
  std::mt19937 random(study.seed);
  std::vector<ExclusionRecord> records;
  for (const bool group_sees_stress : {true, false}) {
    for (std::size_t trainee = 0; trainee < study.trainees_a_group; ++trainee) {
      // People begin differently.
      const double gift = 0.7 + 0.6 * static_cast<double>(random()) / 4294967296.0;
      TraineeSkill skill;
      skill.unevenness_m *= gift;
      skill.beyond_m *= gift;
      for (int session = 1; session <= study.sessions; ++session) {
        for (const bool test : {false, true}) {
          const bool shown = group_sees_stress && !test;
          SimulatedTrainee hand(body, study.fingers, skill, 1 / options.force_rate_hz,
                                static_cast<std::uint32_t>(random()));
          const ExclusionOutcome outcome = runner.run_in_own_time(hand, [&](const ExclusionView& view) {
            hand.see(view, shown);
            return true;
          });
          if (!test) skill = hand.learnt(shown);
          ExclusionRecord record;
          record.group = group_sees_stress ? kStressShown : kStressHidden;
          record.trainee = "simulated, " + record.group + ", " + std::to_string(trainee + 1);
          record.simulated = true;
          record.session = session;
          record.test = test;
          record.stress_shown = shown;
          record.object = body.object().name;
          record.fingers = study.fingers;
          record.conditions = conditions_of(body);
          record.score = outcome.score;
          record.ending = outcome.score.done ? Ending::kDone : Ending::kTimeOver;
          records.push_back(record);
          if (made) made(records.back());
        }
      }
    }
  }
  return records;
}

}  // namespace kiroku::trainer

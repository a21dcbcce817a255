#include "trainer/curriculum/simulated_study.h"

#include <algorithm>

#include "base/error.h"
#include "trainer/curriculum/learning_trainee.h"

namespace kiroku::trainer {
namespace {

/// One trainee of a study, on one object.
class Course {
 public:
  Course(const ExclusionBody& body, ExclusionRunner& runner, double period_s, ExclusionRecord like,
         std::uint32_t seed)
      : body_(body),
        runner_(runner),
        period_s_(period_s),
        like_(std::move(like)),
        trainee_(like_.fingers, seed) {}

  /// An attempt that ends after `most_s` at the latest.
  ExclusionRecord attempt(int session, bool test, bool shown, double most_s) {
    SimulatedTrainee hand(body_, trainee_.next(!test), period_s_);
    const ExclusionOutcome outcome = runner_.run_in_own_time(hand, [&](const ExclusionView& view) {
      hand.see(view, false);  // what is shown is thought over afterwards, not while the hand moves
      return hand.places_tried() == 1 && view.time_s < most_s;
    });
    if (!test) trainee_.learn(shown_of(outcome.score, shown));
    ExclusionRecord record = like_;
    record.session = session;
    record.test = test;
    record.stress_shown = shown;
    record.score = outcome.score;
    record.ending = outcome.score.done ? Ending::kDone : Ending::kTimeOver;
    return record;
  }

 private:
  const ExclusionBody& body_;
  ExclusionRunner& runner_;
  double period_s_;
  ExclusionRecord like_;
  LearningTrainee trainee_;
};

}  // namespace

std::vector<ExclusionRecord> run_simulated_study(const ExclusionBody& body, const SimulatedStudy& study,
                                                 const std::function<void(const ExclusionRecord&)>& made) {
  if (study.shown < 1 || study.hidden < 1 || study.sessions < 1 || !(study.practice_s > 0))
    throw UsageError("a study needs at least one trainee in each group, one session and some practice");
  // Coarse enough to be quick, fine enough for a model: hands are steered by what is seen ten times a second.
  ExclusionOptions options;
  options.force_rate_hz = 200;
  options.picture_rate_hz = 10;
  options.width = 160;
  options.height = 120;
  options.draws = false;
  ExclusionRunner runner(body, options);
  std::mt19937 random(study.seed);
  std::vector<ExclusionRecord> records;
  const auto keep = [&](ExclusionRecord record) {
    records.push_back(std::move(record));
    if (made) made(records.back());
  };
  for (const bool group_sees_stress : {true, false}) {
    for (std::size_t trainee = 0; trainee < (group_sees_stress ? study.shown : study.hidden); ++trainee) {
      ExclusionRecord like;
      like.group = group_sees_stress ? kStressShown : kStressHidden;
      like.trainee = "simulated, " + like.group + ", " + std::to_string(trainee + 1);
      like.simulated = true;
      like.object = body.object().name;
      like.fingers = study.fingers;
      like.conditions = conditions_of(body);
      Course course(body, runner, 1 / options.force_rate_hz, like, static_cast<std::uint32_t>(random()));
      for (int session = 1; session <= study.sessions; ++session) {
        for (double practised_s = 0; practised_s < study.practice_s;) {
          keep(course.attempt(session, false, group_sees_stress, study.practice_s - practised_s));
          practised_s += records.back().score.time_s;
        }
        keep(course.attempt(session, true, false, body.task().most_s));
      }
    }
  }
  return records;
}

Plot plot_of_study(const std::vector<ExclusionRecord>& records, const std::string& object, Measure measure) {
  Plot plot{
      "Training with object " + object,
      "day",
      label_of(measure),
      {},
      false,
      true,
      "simulated trainees: says nothing about people; tests without stress shown; bars: 95 % of the mean"};
  for (const LearningCurve& curve : learning_curves(records, object, measure)) {
    plot.series.push_back(series_of(curve, curve.group));
  }
  return plot;
}

}  // namespace kiroku::trainer

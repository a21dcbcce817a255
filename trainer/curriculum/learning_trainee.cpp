#include "trainer/curriculum/learning_trainee.h"

#include <algorithm>

#include "trainer/haptic_rate/rate_subject.h"

namespace kiroku::trainer {
namespace {

LiftPlan varied(LiftPlan plan, const Variability& by, std::mt19937& random) {
  for (Eigen::Index axis = 0; axis < 2; ++axis) plan.place_m[axis] += by.place_m * standard_normal(random);
  for (double& offset_m : plan.offset_m) offset_m += by.finger_m * standard_normal(random);
  plan.beyond_m = std::max(0.0, plan.beyond_m + by.beyond_m * standard_normal(random));
  return plan;
}

}  // namespace

Shown shown_of(const ExclusionScore& score, bool stress_shown) {
  return {score.done, score.best_visible_share,
          stress_shown ? score.largest_von_mises_pa : score.peak_force_n};
}

bool better(const Shown& one, const Shown& other) {
  if (one.done != other.done) return one.done;
  if (!one.done) return one.best_visible_share > other.best_visible_share;
  return one.cost < other.cost;
}

LearningTrainee::LearningTrainee(std::size_t fingers, std::uint32_t seed)
    : random_(seed), aim_(unpractised_plan(fingers, seed)) {
  constexpr double kBesideMetres = 0.008;
  // People begin differently.
  constexpr double kLeastCare = 0.7, kCareless = 0.6;
  const double care = kLeastCare + kCareless * uniform(random_);
  for (double& offset_m : aim_.offset_m) offset_m *= care;
  aim_.beyond_m *= care;
  aim_.place_m = care * kBesideMetres * Eigen::Vector2d(standard_normal(random_), standard_normal(random_));
  tried_ = aim_;
}

LiftPlan LearningTrainee::next(bool explores) {
  tried_ = explores ? varied(aim_, kExploration, random_) : aim_;
  return varied(tried_, kMotorNoise, random_);
}

void LearningTrainee::learn(const Shown& shown) {
  if (best_ && !better(shown, *best_)) return;
  best_ = shown;
  aim_ = tried_;
}

}  // namespace kiroku::trainer

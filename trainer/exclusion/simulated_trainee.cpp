#include "trainer/exclusion/simulated_trainee.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <boost/math/distributions/normal.hpp>

#include "base/error.h"
#include "trainer/haptic_rate/rate_subject.h"

namespace kiroku::trainer {
namespace {

constexpr double kBeginBelowMetres = 0.012;
/// Who has lifted so far without seeing the line lifts no further, at that place.
constexpr double kMostLiftMetres = 0.09;
/// A finger that has to press harder, as the picture's numbers tell it (what a device plays ends at 10 N),
/// and stress nearer to damage where it is shown, are too much.
constexpr double kTooHardNewtons = 30, kTooMuchOfDamage = 0.85;
/// A hand that lifts nothing moves as quickly.
constexpr double kFreeSpeedMetres = 0.1;
/// That much is felt of an organ that is in a hand's way; then it goes lower, but not lower than that.
constexpr double kTouchNewtons = 0.05, kLowestMetres = -0.03;
/// Places to try, along the border and further in.
constexpr std::array<std::array<double, 2>, 8> kPlacesMetres{
    {{0, 0.018}, {0, 0.036}, {0.02, 0}, {-0.02, 0}, {0.02, 0.018}, {-0.02, 0.018}, {0.04, 0}, {-0.04, 0}}};

}  // namespace

LiftPlan unpractised_plan(std::size_t fingers, std::uint32_t seed) {
  (void)side_by_side_m(fingers);  // refuses what no hand has
  LiftPlan plan;
  std::mt19937 random(seed);
  for (std::size_t i = 0; i < fingers; ++i) {
    const double within = std::clamp(uniform(random), 0.02, 0.98);
    plan.offset_m.push_back(kUnevenMetres * boost::math::quantile(boost::math::normal(), within));
  }
  return plan;
}

SimulatedTrainee::SimulatedTrainee(const ExclusionBody& body, LiftPlan plan, double period_s)
    : plan_(std::move(plan)),
      period_s_(period_s),
      needed_share_(body.task().visible_share),
      damage_pa_(body.task().damage_pa),
      lifts_(body.task().lifts),
      aside_(body.task().aside),
      away_(body.task().away()),
      held_(body.task().lifting_hand()),
      begins_m_(body.task().under_border_m - kBeginBelowMetres * lifts_),
      side_by_side_m_(side_by_side_m(plan_.offset_m.size())),
      felt_n_(plan_.offset_m.size(), sim::Vector3::Zero()),
      at_m_(plan_.place_m),
      goes_to_m_(at_m_),
      goal_m_(kBeginBelowMetres + kMostLiftMetres) {}

bool SimulatedTrainee::read(std::span<sim::Pose> poses) {
  // Uneven from the first touch on, not before.
  const double share = std::clamp(lifted_m_ / kBeginBelowMetres, 0.0, 1.0);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    poses[i].orientation = held_;
    poses[i].position_m = begins_m_ + (at_m_.x() + side_by_side_m_[i]) * aside_ + at_m_.y() * away_ +
                          (lifted_m_ + share * plan_.offset_m[i]) * lifts_;
  }
  return true;
}

void SimulatedTrainee::write(std::span<const sim::Vector3> forces_n) {
  std::ranges::copy(forces_n, felt_n_.begin());
  const double free_m = kFreeSpeedMetres * period_s_;
  switch (doing_) {
    case Doing::kLifts:
      if (lifted_m_ < goal_m_) lifted_m_ = std::min(goal_m_, lifted_m_ + plan_.speed_m_s * period_s_);
      break;
    case Doing::kComesBack:
      // It may be below where it began, having gone under what was in its way.
      if (lifted_m_ > 0) lifted_m_ = std::max(0.0, lifted_m_ - free_m);
      if (lifted_m_ <= 0) doing_ = Doing::kMovesOn;
      break;
    case Doing::kMovesOn: {
      if (any_above(kTouchNewtons, felt_n_) && lifted_m_ > kLowestMetres) {
        lifted_m_ -= free_m;
        break;
      }
      const Place way_m = goes_to_m_ - at_m_;
      at_m_ += way_m * std::min(1.0, free_m / std::max(way_m.norm(), free_m));
      if (way_m.norm() <= free_m) doing_ = Doing::kLifts;
      break;
    }
  }
}

void SimulatedTrainee::see(const ExclusionView& view, bool shown_stress) {
  if (doing_ != Doing::kLifts) return;
  if (!sees_line_ && view.visible_share >= needed_share_) {
    sees_line_ = true;
    goal_m_ = lifted_m_ + plan_.beyond_m;
  }
  best_here_ = std::max(best_here_, view.visible_share);
  if (shown_stress && view.largest_von_mises_pa >= 0.4 * damage_pa_) even_out();
  const bool too_much = shown_stress && view.largest_von_mises_pa > kTooMuchOfDamage * damage_pa_;
  if (too_much || any_above(kTooHardNewtons, view.hand.forces_n)) {
    // What is seen is held, what is not is looked for elsewhere.
    goal_m_ = lifted_m_;
    if (view.visible_share < needed_share_) go_on_elsewhere();
    return;
  }
  if (lifted_m_ >= goal_m_ && view.visible_share < needed_share_) go_on_elsewhere();
}

/// To the next place; to the one from where most of the line was seen once all were tried.
void SimulatedTrainee::go_on_elsewhere() {
  if (best_here_ > best_share_) {
    best_share_ = best_here_;
    best_m_ = at_m_;
  }
  best_here_ = 0;
  goes_to_m_ = next_place_ < kPlacesMetres.size()
                   ? Place(kPlacesMetres.at(next_place_)[0], kPlacesMetres.at(next_place_)[1])
                   : best_m_;
  ++next_place_;
  ++tried_;
  sees_line_ = false;
  goal_m_ = kBeginBelowMetres + kMostLiftMetres;
  doing_ = Doing::kComesBack;
}

/// The finger that presses hardest gives way, the one that presses least helps.
void SimulatedTrainee::even_out() {
  const auto pressed = [](const sim::Vector3& force_n) { return force_n.norm(); };
  const auto hardest =
      static_cast<std::size_t>(std::ranges::max_element(felt_n_, {}, pressed) - felt_n_.begin());
  const auto least =
      static_cast<std::size_t>(std::ranges::min_element(felt_n_, {}, pressed) - felt_n_.begin());
  constexpr double kStepMetres = 2e-4;
  plan_.offset_m[hardest] -= kStepMetres;
  plan_.offset_m[least] += kStepMetres;
}

}  // namespace kiroku::trainer

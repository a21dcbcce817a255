#include "trainer/exclusion/simulated_trainee.h"

#include <algorithm>
#include <cmath>

#include <boost/math/distributions/normal.hpp>

#include "base/error.h"
#include "trainer/haptic_rate/rate_subject.h"

namespace kiroku::trainer {
namespace {

constexpr double kBeginBelowMetres = 0.012;
/// Who has lifted so far without seeing the line lifts no further.
constexpr double kMostLiftMetres = 0.03;

}  // namespace

SimulatedTrainee::SimulatedTrainee(const ExclusionBody& body, std::size_t fingers, const TraineeSkill& skill,
                                   double period_s, std::uint32_t seed)
    : skill_(skill),
      period_s_(period_s),
      needed_share_(body.task().visible_share),
      damage_pa_(body.task().damage_pa),
      lifts_(body.task().lifts),
      poses_(fingertips(fingers).size()),
      felt_n_(fingers, sim::Vector3::Zero()),
      goal_m_(kBeginBelowMetres + kMostLiftMetres) {
  std::mt19937 random(seed);
  for (std::size_t i = 0; i < fingers; ++i) {
    poses_[i].position_m = body.task().under_border_m + side_by_side_m(fingers)[i] * body.task().aside -
                           kBeginBelowMetres * lifts_;
    const double within = std::clamp(uniform(random), 0.02, 0.98);
    offset_m_.push_back(skill.unevenness_m * boost::math::quantile(boost::math::normal(), within));
  }
}

bool SimulatedTrainee::read(std::span<sim::Pose> poses) {
  std::ranges::copy(poses_, poses.begin());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    // Uneven from the first touch on, not before.
    const double share = std::clamp(lifted_m_ / kBeginBelowMetres, 0.0, 1.0);
    poses[i].position_m += (lifted_m_ + share * offset_m_[i]) * lifts_;
  }
  return true;
}

void SimulatedTrainee::write(std::span<const sim::Vector3> forces_n) {
  std::ranges::copy(forces_n, felt_n_.begin());
  if (lifted_m_ < goal_m_) lifted_m_ = std::min(goal_m_, lifted_m_ + skill_.speed_m_s * period_s_);
}

void SimulatedTrainee::see(const ExclusionView& view, bool shown_stress) {
  if (!sees_line_ && view.visible_share >= needed_share_) {
    sees_line_ = true;
    goal_m_ = lifted_m_ + skill_.beyond_m;
  }
  if (!shown_stress || view.largest_von_mises_pa < 0.4 * damage_pa_) return;
  // The finger that presses hardest gives way, the one that presses least helps.
  const auto pressed = [](const sim::Vector3& force_n) { return force_n.norm(); };
  const auto hardest =
      static_cast<std::size_t>(std::ranges::max_element(felt_n_, {}, pressed) - felt_n_.begin());
  const auto least =
      static_cast<std::size_t>(std::ranges::min_element(felt_n_, {}, pressed) - felt_n_.begin());
  constexpr double kStepMetres = 2e-4;
  offset_m_[hardest] -= kStepMetres;
  offset_m_[least] += kStepMetres;
}

TraineeSkill SimulatedTrainee::learnt(bool shown_stress) const {
  TraineeSkill after = skill_;
  after.unevenness_m *= shown_stress ? 0.65 : 0.95;
  after.beyond_m *= shown_stress ? 0.7 : 0.9;
  after.speed_m_s = std::min(after.speed_m_s * 1.12, 0.012);
  return after;
}

}  // namespace kiroku::trainer

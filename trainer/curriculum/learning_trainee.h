// A simulated trainee that learns by what it is shown, and by nothing else.
//
// Source of the model: people explore by the variability of their own movements, and aim at what turned out
// better (Wu, Miyamoto, Gonzalez Castro, Ölveczky and Smith, "Temporal structure of motor variability is
// dynamically regulated and predicts motor learning ability", Nature Neuroscience 17, 2014; Therrien, Wolpert
// and Bastian, "Effective reinforcement learning following cerebellar damage requires a balance between
// exploration and motor noise", Brain 139, 2016). So there is no rate of learning: how fast the stress falls
// follows from what is seen of it, from the variability, from the time that practice leaves, and from the
// mechanics of the object.
#pragma once

#include <optional>
#include <random>

#include "trainer/exclusion/simulated_trainee.h"

namespace kiroku::trainer {

/// What a trainee has of an attempt, to tell whether it was better.
struct Shown {
  bool done = false;
  double best_visible_share = 0;
  /// What was to be low: the largest stress where it was shown, else the largest force that a finger felt.
  double cost = 0;
};
/// What is shown of an attempt: the stress of those who see it, the force of all others.
Shown shown_of(const ExclusionScore& score, bool stress_shown);
/// Done goes before not done; then the lower cost; of what is not done, that from which more of the line was
/// seen.
bool better(const Shown& one, const Shown& other);

/// How movements vary, standard deviations.
struct Variability {
  double place_m = 0, finger_m = 0, beyond_m = 0;
};
/// What practice tries out, and what no hand can help. Ours: of a reach of some centimetres.
inline constexpr Variability kExploration{0.004, 0.0015, 0.0015}, kMotorNoise{0.001, 0.0004, 0.0004};

/// Not thread-safe. The same seed gives the same.
class LearningTrainee {
 public:
  /// With so many fingers (1 to 5), unpractised: uneven, and beside the place where a hand goes best by
  /// chance.
  LearningTrainee(std::size_t fingers, std::uint32_t seed);

  /// How the next attempt comes out: what is aimed at, what is tried out where it explores, as in practice,
  /// and the hand's noise.
  [[nodiscard]] LiftPlan next(bool explores);
  /// What was shown of the attempt that next() gave last; only practice is to be told. Where it was better
  /// than all before it, what was tried out is aimed at from now on; the hand's noise is not known to it.
  void learn(const Shown& shown);

  [[nodiscard]] const LiftPlan& aim() const { return aim_; }

 private:
  std::mt19937 random_;
  LiftPlan aim_, tried_;
  std::optional<Shown> best_;
};

}  // namespace kiroku::trainer

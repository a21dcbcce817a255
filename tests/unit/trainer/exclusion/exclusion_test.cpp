#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/unit/trainer/made_object.h"
#include "trainer/exclusion/exclusion_run.h"
#include "trainer/exclusion/simulated_trainee.h"
#include "trainer/exclusion/task_trial.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

ExclusionBody body_of(std::size_t vertices) {
  OrganObject object = made_object(ObjectKind::kLiver, vertices);
  const ExclusionTask task = exclusion_task(ObjectKind::kLiver);
  return ExclusionBody(std::move(object), task);
}

const ExclusionBody& body() {
  static const ExclusionBody kBody = body_of(900);
  return kBody;
}

/// As many vertices as the command takes by default: one fingertip alone goes between the nodes of fewer.
const ExclusionBody& fine_body() {
  static const ExclusionBody kBody = body_of(2000);
  return kBody;
}

ExclusionOptions quick() {
  ExclusionOptions options;
  options.force_rate_hz = 500;
  options.picture_rate_hz = 10;
  options.width = 320;
  options.height = 240;
  return options;
}

/// Fingertips under the border that lift it by `lift_m` within two seconds and stay there.
HandMotion lifting(std::size_t fingers, double lift_m) {
  HandMotion motion;
  motion.fingers = fingers;
  const double touching_m = -half_thickness_m(ObjectKind::kLiver) - kFingertipMetres + 0.002;
  for (const double time_s : {0.0, 2.0, 10.0}) {
    std::vector<sim::Pose> poses(fingers);
    for (std::size_t i = 0; i < fingers; ++i) {
      const double share = fingers == 1 ? 0.5 : static_cast<double>(i) / static_cast<double>(fingers - 1);
      poses[i].position_m = {-0.04 + 0.08 * share, -0.045, touching_m + std::min(time_s / 2, 1.0) * lift_m};
    }
    motion.times_s.push_back(time_s);
    motion.poses.push_back(poses);
  }
  return motion;
}

ExclusionOutcome attempt(const HandMotion& motion, const ExclusionOptions& options,
                         const ExclusionObserver& observer = {}) {
  ExclusionRunner runner(body(), options);
  MotionPlayer player(motion, 1 / options.force_rate_hz);
  return runner.run_in_own_time(player, observer);
}

TEST(ExclusionTask, TheLineIsHiddenAtRestAndSeenWhenTheBorderIsLifted) {
  sim::SurfaceRenderer renderer(body().object().mesh, sim::GpuUse::kOff);
  VisibilityMeter meter(renderer, body().task(), 640, 480);
  EXPECT_EQ(meter.visible_share({}), 0);
  EXPECT_EQ(geometric_visible_share(body().object().mesh, {}, body().task()), 0);
}

TEST(ExclusionTask, VesselsHideTheLineAndASimulatedTraineePushesThemAside) {
  OrganObject object = made_object(ObjectKind::kVessels, 2000);
  const ExclusionTask task = exclusion_task(ObjectKind::kVessels);
  const ExclusionBody vessels(std::move(object), task);
  EXPECT_EQ(geometric_visible_share(vessels.object().mesh, {}, task), 0);
  for (const std::size_t fingers : {1U, 3U, 5U})
    EXPECT_EQ(doubt_about(vessels, std::array{fingers}), "") << fingers;
}

TEST(ExclusionTask, WhatThePictureShowsOfTheLineIsWhatGeometrySays) {
  sim::SurfaceRenderer renderer(body().object().mesh, sim::GpuUse::kOff);
  VisibilityMeter meter(renderer, body().task(), 640, 480), fine(renderer, body().task(), 2560, 1920);
  sim::ContactSolver solver(body().contact().whole_surface(), fingertips(3, 0));
  double worst = 0, worst_fine = 0, partly = 0;
  for (int step = 0; step <= 24; ++step) {
    HandMotion motion = lifting(3, 1e-3 * step);
    // Unevenly, so that parts of the line are seen.
    motion.poses[2][0].position_m.z() += 2e-4 * step;
    const sim::ContactResult& result = solver.step(motion.poses[2]);
    Eigen::VectorXd displacement_m;
    body().contact().displacement_m(result.contacts, displacement_m);
    const std::span<const double> displacement(displacement_m.data(),
                                               static_cast<std::size_t>(displacement_m.size()));
    const double rendered = meter.visible_share(displacement);
    const double computed = geometric_visible_share(body().object().mesh, displacement, body().task());
    worst = std::max(worst, std::abs(rendered - computed));
    worst_fine = std::max(worst_fine, std::abs(fine.visible_share(displacement) - computed));
    if (computed > 0.1 && computed < 0.9) ++partly;
  }
  EXPECT_GE(partly, 3);
  // The line is three pixels thick in the smaller picture.
  EXPECT_LT(worst, 0.12);
  EXPECT_LT(worst_fine, 0.03);
  RecordProperty("largest_difference_640x480", std::to_string(worst));
  RecordProperty("largest_difference_2560x1920", std::to_string(worst_fine));
}

TEST(ExclusionJudge, AsksForTheLineToStayVisible) {
  ExclusionTask task;
  task.most_s = 10;
  ExclusionJudge judge(task);
  const auto see = [&](double time_s, double share) { judge.see({time_s, share, 1e3 * time_s, 0}); };
  see(0, 0.95);
  see(0.9, 0.95);
  see(0.95, 0.5);  // just before
  EXPECT_FALSE(judge.over());
  see(1.0, 0.9);
  see(1.9, 1);
  EXPECT_NEAR(judge.held_s(), 0.9, 1e-12);
  see(2.0, 0.9);
  EXPECT_TRUE(judge.over());
  EXPECT_TRUE(judge.score().done);
  see(3, 0);
  EXPECT_EQ(judge.score().time_s, 2.0);
  EXPECT_EQ(judge.score().largest_von_mises_pa, 2e3);
  ExclusionJudge late(task);
  late.see({10, 0.2, 0, 0});
  EXPECT_TRUE(late.over());
  EXPECT_FALSE(late.score().done);
}

TEST(ExclusionJudge, StressIsHeardBeforeItDamages) {
  EXPECT_EQ(danger(1e3, 3e4), 0);
  EXPECT_EQ(danger_tone_hz(0), 0);
  EXPECT_EQ(danger(2.25e4, 3e4), 0.5);
  EXPECT_NEAR(danger_tone_hz(0.5), 440, 1e-9);
  EXPECT_NEAR(danger_tone_hz(danger(9e9, 3e4)), 880, 1e-9);
}

TEST(HandForces, AreWholeOrAlongTheFinger) {
  sim::Pose pose;
  EXPECT_EQ(played_n(Feedback::kFull, pose, {1, 2, 3}), Vector3(1, 2, 3));
  EXPECT_TRUE(played_n(Feedback::kTangential, pose, {1, 2, 3}).isApprox(Vector3(0, 0, 3)));
  pose.orientation = Eigen::AngleAxisd(0.3, Vector3::UnitX());
  const Vector3 force_n(0, 0, 2);
  // f cos(theta) along the finger.
  EXPECT_NEAR(played_n(Feedback::kTangential, pose, force_n).norm(), 2 * std::cos(0.3), 1e-12);
  EXPECT_THROW((void)feedback_of("half"), UsageError);
  EXPECT_THROW((void)fingertips(6, 0), UsageError);
}

TEST(ExclusionRun, LiftingTheBorderEnoughIsDoneAndLiftingItTooLittleIsNot) {
  const ExclusionOutcome done = attempt(lifting(3, 0.016), quick());
  EXPECT_TRUE(done.score.done);
  EXPECT_GT(done.score.time_s, 1);
  EXPECT_LT(done.score.time_s, 4);
  EXPECT_GT(done.score.peak_wrist_n, done.score.peak_force_n);
  EXPECT_GT(done.score.largest_von_mises_pa, 1e3);
  EXPECT_GT(done.score.path_m, 3 * 0.010);
  EXPECT_LT(done.score.path_m, 3 * 0.017);
  ExclusionOptions options = quick();
  options.most_s = 4;
  const ExclusionOutcome missed = attempt(lifting(3, 0.002), options);
  EXPECT_FALSE(missed.score.done);
  EXPECT_LT(missed.score.best_visible_share, 0.9);
  EXPECT_NEAR(missed.elapsed_s, 4, 0.2);
}

TEST(ExclusionRun, TheSameMotionGivesTheSameScoreToTheBit) {
  const ExclusionOutcome first = attempt(lifting(2, 0.016), quick()), again = attempt(first.motion, quick());
  const ExclusionOutcome third = attempt(first.motion, quick());
  EXPECT_EQ(again.score.largest_von_mises_pa, third.score.largest_von_mises_pa);
  EXPECT_EQ(again.score.path_m, third.score.path_m);
  // What was recorded is what was played, but for what lies between its moments.
  EXPECT_NEAR(first.score.largest_von_mises_pa, again.score.largest_von_mises_pa,
              0.02 * first.score.largest_von_mises_pa);
}

TEST(ExclusionRun, WristFeelsAllFingersAndIsInEquilibriumWithTheEnds) {
  bool looked = false;
  attempt(lifting(3, 0.012), quick(), [&](const ExclusionView& view) {
    if (view.time_s < 2.5) return true;
    looked = true;
    Vector3 sum_n = Vector3::Zero();
    for (const Vector3& force_n : view.hand.forces_n) sum_n += force_n;
    EXPECT_TRUE(sum_n.isApprox(view.hand.wrist_n, 1e-12));
    EXPECT_LT(view.hand.wrist_n.z(), -0.5);
    return false;
  });
  EXPECT_TRUE(looked);
}

TEST(ExclusionRun, StressAndGhostAreSeenWhereTheyAreShown) {
  const auto picture_at_end = [&](const ExclusionOptions& options) {
    sim::Picture last;
    attempt(lifting(2, 0.012), options, [&](const ExclusionView& view) {
      last = *view.picture;
      return view.time_s < 2;
    });
    return last;
  };
  ExclusionOptions options = quick();
  const sim::Picture plain = picture_at_end(options);
  options.shows_stress = true;
  EXPECT_NE(picture_at_end(options).rgb, plain.rgb);
  options = quick();
  options.ghost = lifting(2, 0);
  options.ghost->poses[0][0].position_m = options.ghost->poses[1][0].position_m =
      options.ghost->poses[2][0].position_m = {0.05, -0.09, 0};
  const sim::Picture with_ghost = picture_at_end(options);
  int blue = 0;
  for (std::size_t at = 0; at < plain.rgb.size(); at += 3) {
    if (plain.rgb[at + 2] < 60 && with_ghost.rgb[at + 2] > 90) ++blue;
  }
  EXPECT_GT(blue, 30);
}

TEST(ExclusionRun, RunsInRealTimeWithAForceLoopBesideThePictures) {
  ExclusionOptions options = quick();
  options.most_s = 1;
  ExclusionRunner runner(body(), options);
  MotionPlayer player(lifting(2, 0.012), 1 / options.force_rate_hz);
  const ExclusionOutcome outcome = runner.run_in_real_time(player);
  ASSERT_TRUE(outcome.force_loop);
  EXPECT_GT(outcome.force_loop->steps, 50U);
  EXPECT_GT(outcome.pictures, 1U);
  EXPECT_GT(outcome.score.peak_force_n, 0.01);
}

TEST(ExclusionRun, ADeviceThatFailsEndsForcesNotTheProgram) {
  class Failing : public sim::HapticDevice {
   public:
    explicit Failing(const HandMotion& motion) : player(motion, 2e-3) {}
    [[nodiscard]] std::size_t tools() const override { return 2; }
    bool read(std::span<sim::Pose> poses) override {
      player.read(poses);
      if (steps > 500) poses[1].position_m.y() = std::numeric_limits<double>::quiet_NaN();
      return true;
    }
    void write(std::span<const Vector3> forces_n) override {
      player.write(forces_n);
      for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_LE((forces_n[i] - last_n[i]).norm(), 400 * 2e-3 + 1e-9);
        last_n[i] = forces_n[i];
      }
      ++steps;
      if (steps == 500) felt_n = forces_n[0].norm();
    }
    MotionPlayer player;
    int steps = 0;
    double felt_n = 0;
    std::array<Vector3, 2> last_n{Vector3::Zero(), Vector3::Zero()};
  };
  Failing device(lifting(2, 0.016));
  ExclusionOptions options = quick();
  options.most_s = 2;
  ExclusionRunner runner(body(), options);
  const ExclusionOutcome outcome = runner.run_in_own_time(device);
  EXPECT_GT(device.felt_n, 0.1);
  EXPECT_EQ(device.last_n[0], Vector3::Zero());
  EXPECT_GT(outcome.faults.unsound, 400U);
}

/// A hand that moves by a file and has a wrist; keeps what both were given last.
class HandWithWrist : public MotionPlayer {
 public:
  using MotionPlayer::MotionPlayer;
  [[nodiscard]] bool has_wrist() const override { return true; }
  [[nodiscard]] sim::Pose wrist() const override {
    return {{0, -0.2, -0.05}, Eigen::Quaterniond::Identity()};
  }
  void write_wrist(const sim::WristForce& wrist) override { given = wrist; }
  void write(std::span<const Vector3> forces_n) override {
    MotionPlayer::write(forces_n);
    played_n.assign(forces_n.begin(), forces_n.end());
  }
  sim::WristForce given;
  std::vector<Vector3> played_n;
};

/// Eq. 6, in each way of feedback: what the fingers are not played the wrist bears all the same.
TEST(ExclusionRun, TheWristIsGivenTheSumOfTheWholeForcesAndItsTorque) {
  for (const Feedback feedback : {Feedback::kFull, Feedback::kTangential}) {
    ExclusionOptions options = quick();
    options.feedback = feedback;
    options.most_s = 2.5;  // half a second after the hand has come to rest
    options.draws = false;
    options.limits.most_force_n = options.limits.most_wrist_n = 100;  // not what is asked here
    options.limits.most_wrist_nm = 10;
    HandMotion motion = lifting(3, 0.012);
    for (std::vector<sim::Pose>& poses : motion.poses)  // bent, so that a part of each force is left out
      for (sim::Pose& pose : poses)
        pose.orientation = Eigen::AngleAxisd(0.7, Vector3(0.3, 1, 0).normalized());
    HandWithWrist device(motion, 1 / options.force_rate_hz);
    ExclusionRunner runner(body(), options);
    HandForces::State last;
    (void)runner.run_in_own_time(device, [&](const ExclusionView& view) {
      last = view.hand;
      return true;
    });
    ASSERT_TRUE(last.wrist_torque_nm);
    Vector3 sum_n = Vector3::Zero(), played_n = Vector3::Zero(), sum_nm = Vector3::Zero();
    for (std::size_t i = 0; i < 3; ++i) {
      sum_n += last.forces_n[i];
      played_n += device.played_n[i];
      sum_nm += (last.poses[i].position_m - device.wrist().position_m).cross(last.forces_n[i]);
    }
    EXPECT_GT(sum_n.norm(), 1);
    EXPECT_LE((device.given.force_n - sum_n).norm(), 1e-6 * sum_n.norm());
    EXPECT_LE((device.given.torque_nm - *last.wrist_torque_nm).norm(), 1e-6);
    // Friction turns a fingertip about its own middle, too: at most by all of its force at its radius.
    EXPECT_LE((*last.wrist_torque_nm - sum_nm).norm(),
              kFingertipMetres * body().task().friction * 3 * sum_n.norm());
    EXPECT_GT(sum_nm.norm(), 0.1);
    const double left_out_n = (device.given.force_n - played_n).norm();
    if (feedback == Feedback::kFull) {
      EXPECT_LE(left_out_n, 1e-6 * sum_n.norm());
    } else {
      EXPECT_GT(left_out_n, 0.1 * sum_n.norm());
    }
  }
}

TEST(ExclusionRun, AHandWithoutAWristHasNoTorqueThere) {
  HandForces::State last;
  ExclusionOptions options = quick();
  options.most_s = 0.5;
  options.draws = false;
  (void)attempt(lifting(2, 0.01), options, [&](const ExclusionView& view) {
    last = view.hand;
    return true;
  });
  EXPECT_TRUE(last.any);
  EXPECT_FALSE(last.wrist_torque_nm);
}

TEST(SimulatedTrainee, FinishesWithOneToFiveFingers) {
  for (std::size_t fingers = 1; fingers <= 5; ++fingers) {
    const ExclusionBody& object = fingers == 1 ? fine_body() : body();
    ExclusionRunner runner(object, quick());
    SimulatedTrainee trainee(object, unpractised_plan(fingers, 3), 2e-3);
    const ExclusionOutcome outcome = runner.run_in_own_time(trainee, [&](const ExclusionView& view) {
      trainee.see(view, false);
      return true;
    });
    EXPECT_TRUE(outcome.score.done) << fingers;
    EXPECT_EQ(outcome.faults.jumps, 0U);
  }
}

TEST(SimulatedTrainee, GoesOnElsewhereFromBelowWithoutAJump) {
  SimulatedTrainee trainee(body(), unpractised_plan(1, 1), 2e-3);
  std::vector<sim::Pose> before(1), poses(1);
  trainee.read(before);
  double longest_m = 0;
  const auto steps = [&](int count, double newtons) {
    for (int i = 0; i < count; ++i) {
      trainee.write(std::vector<Vector3>{{0, 0, -newtons}});
      trainee.read(poses);
      longest_m = std::max(longest_m, (poses[0].position_m - before[0].position_m).norm());
      before = poses;
    }
  };
  ExclusionView hard;
  hard.hand.forces_n = {Vector3(0, 0, -31)};
  steps(1000, 0);
  trainee.see(hard, false);
  steps(250, 1);  // back, and on below what it meets there
  steps(200, 0);  // until it lifts again
  const double low_m = before[0].position_m.z();
  trainee.see(hard, false);
  EXPECT_EQ(trainee.places_tried(), 3);
  steps(10, 0);
  EXPECT_LT(before[0].position_m.z(), low_m + 1e-3);
  EXPECT_LT(longest_m, 5e-4);
}

TEST(ExclusionRun, RefusesOptionsWithoutSense) {
  ExclusionOptions options = quick();
  options.picture_rate_hz = 0;
  EXPECT_THROW(ExclusionRunner(body(), options), UsageError);
  options = quick();
  options.width = -1;
  EXPECT_THROW(ExclusionRunner(body(), options), UsageError);
}

}  // namespace
}  // namespace kiroku::trainer

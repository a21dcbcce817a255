#include "trainer/exclusion/press_cue.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "tests/unit/trainer/made_object.h"
#include "trainer/exclusion/exclusion_run.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

TEST(PressCue, ComesInUpToTheLowerForceAndIsBlueThereAndRedAtTheHigherOne) {
  EXPECT_EQ(press_cue(0).share, 0);
  EXPECT_EQ(press_cue(0.25).share, 0);
  EXPECT_NEAR(press_cue(0.375).share, 0.5, 1e-12);
  EXPECT_EQ(press_cue(0.5).share, 1);
  EXPECT_EQ(press_cue(0.5).colour, (sim::Rgb{0, 0, 255}));
  EXPECT_EQ(press_cue(0.75).colour, (sim::Rgb{128, 0, 128}));
  EXPECT_EQ(press_cue(1).colour, (sim::Rgb{255, 0, 0}));
  EXPECT_EQ(press_cue(12).colour, (sim::Rgb{255, 0, 0}));
  EXPECT_EQ(with_cue({100, 100, 100}, {{0, 200, 50}, 0.25}), (sim::Rgb{75, 125, 88}));
}

TEST(PressCue, ColoursTissueAtTheFingersAndNoOther) {
  const sim::TetMesh& mesh = made_object(ObjectKind::kLiver, 2000).mesh;
  std::vector<double> displacement_m(3 * mesh.nodes.size(), 0);
  constexpr sim::Rgb kPlain{90, 90, 90};
  HandForces::State hand;
  hand.any = true;
  // Below the sheet, touching it: one finger presses firmly, one lightly, one not at all.
  const double z_m = -half_thickness_m(ObjectKind::kLiver) - kFingertipMetres;
  for (const double x_m : {-0.05, 0.0, 0.05})
    hand.poses.push_back({{x_m, -0.02, z_m}, Eigen::Quaterniond::Identity()});
  hand.forces_n = {{0, 0, 3}, {0, 0.3, -0.4}, {0, 0, 0.1}};
  std::vector<sim::Rgb> colours(mesh.nodes.size(), kPlain);
  colour_pressed_tissue(mesh, displacement_m, hand, colours);
  std::array<int, 3> coloured{};
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (colours[node] == kPlain) continue;
    const auto near = [&](const sim::Pose& pose) { return (mesh.nodes[node] - pose.position_m).norm(); };
    const auto nearest = std::ranges::min_element(hand.poses, {}, near);
    EXPECT_LT(near(*nearest), 2 * kFingertipMetres);
    const auto finger = static_cast<std::size_t>(nearest - hand.poses.begin());
    ++coloured[finger];
    // Towards red, or towards blue.
    EXPECT_GT(colours[node][finger == 0 ? 0 : 2], colours[node][finger == 0 ? 2 : 0]);
  }
  EXPECT_GT(coloured[0], 0);
  EXPECT_GT(coloured[1], 0);
  EXPECT_EQ(coloured[2], 0);
  // Tissue that was lifted away is not touched any more.
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) displacement_m[3 * node + 2] = 0.02;
  std::vector<sim::Rgb> lifted(mesh.nodes.size(), kPlain);
  colour_pressed_tissue(mesh, displacement_m, hand, lifted);
  EXPECT_TRUE(std::ranges::all_of(lifted, [&](const sim::Rgb& colour) { return colour == kPlain; }));
}

/// Pixels of a pure colour, however they are shaded.
int pixels_of(const sim::Picture& picture, std::size_t channel) {
  int found = 0;
  for (std::size_t at = 0; at + 2 < picture.rgb.size(); at += 3) {
    const int own = picture.rgb[at + channel],
              others = picture.rgb[at] + picture.rgb[at + 1] + picture.rgb[at + 2] - own;
    found += own > 40 && others < own / 4 ? 1 : 0;
  }
  return found;
}

TEST(PressCue, IsInThePictureWhereItIsAskedForAndChangesNothingElse) {
  const ExclusionTask task = exclusion_task(ObjectKind::kLiver);
  const ExclusionBody body(made_object(ObjectKind::kLiver, 900), task);
  HandMotion motion;
  motion.fingers = 2;
  const double touching_m = -half_thickness_m(ObjectKind::kLiver) - kFingertipMetres + 0.002;
  for (const double time_s : {0.0, 1.0, 4.0}) {
    motion.times_s.push_back(time_s);
    std::vector<sim::Pose>& poses = motion.poses.emplace_back(2);
    for (std::size_t i = 0; i < 2; ++i)
      poses[i].position_m = {i == 0 ? -0.03 : 0.03, -0.055, touching_m + std::min(time_s, 1.0) * 0.012};
  }
  double score_pa = 0;
  for (const bool shows : {false, true}) {
    ExclusionOptions options;
    options.force_rate_hz = 500;
    options.picture_rate_hz = 10;
    options.shows_press = shows;
    options.most_s = 1.5;
    ExclusionRunner runner(body, options);
    MotionPlayer player(motion, 1 / options.force_rate_hz);
    int red = 0;
    double most_n = 0;
    const ExclusionOutcome outcome = runner.run_in_own_time(player, [&](const ExclusionView& view) {
      red = pixels_of(*view.picture, 0);
      for (const Vector3& force_n : view.hand.forces_n) most_n = std::max(most_n, force_n.norm());
      return true;
    });
    EXPECT_GT(most_n, 1);
    if (shows) {
      EXPECT_GT(red, 100);
      EXPECT_EQ(outcome.score.largest_von_mises_pa, score_pa);
    } else {
      EXPECT_EQ(red, 0);
      score_pa = outcome.score.largest_von_mises_pa;
    }
  }
}

}  // namespace
}  // namespace kiroku::trainer

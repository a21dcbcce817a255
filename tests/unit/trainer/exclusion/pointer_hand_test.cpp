#include "trainer/exclusion/pointer_hand.h"

#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/unit/trainer/made_object.h"
#include "trainer/exclusion/exclusion_run.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;
using testing::HasSubstr;

constexpr double kPeriod = 1e-3;

const ExclusionBody& kept_body(std::size_t vertices) {
  const auto make = [](std::size_t count) {
    OrganObject object = made_object(ObjectKind::kLiver, count);
    const ExclusionTask task = exclusion_task(ObjectKind::kLiver);
    return ExclusionBody(std::move(object), task);
  };
  if (vertices == 900) {
    static const ExclusionBody kCoarse = make(900);
    return kCoarse;
  }
  static const ExclusionBody kFine = make(2000);
  return kFine;
}

sim::Camera camera() { return camera_of(kept_body(900).task(), 640, 480); }

/// Where a place is in the picture.
Eigen::Vector2d in_picture(const Vector3& place_m) {
  const sim::Camera seen = camera();
  const Vector3 view_m = seen.view_m(place_m);
  return {(view_m.x() / -view_m.z() / seen.half_extent.x() + 1) / 2,
          (1 - view_m.y() / -view_m.z() / seen.half_extent.y()) / 2};
}

/// The hand after so long, forces aside.
std::vector<sim::Pose> later(PointerHand& hand, double seconds) {
  std::vector<sim::Pose> poses(hand.tools());
  const std::vector<Vector3> nothing(hand.tools(), Vector3::Zero());
  for (int step = 0; step < static_cast<int>(seconds / kPeriod); ++step) {
    EXPECT_TRUE(hand.read(poses));
    hand.write(nothing);
  }
  return poses;
}

double nearest_node_m(const Vector3& place_m) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Vector3& node : kept_body(900).object().mesh.nodes)
    nearest = std::min(nearest, (node - place_m).norm());
  return nearest;
}

std::string refusal(const std::function<void()>& action) {
  try {
    action();
  } catch (const UsageError& error) {
    return error.what();
  }
  return "nothing was refused";
}

TEST(PointerHand, AFingertipTouchesTheOrganWhereItsPointerComesDown) {
  PointerHand hand(kept_body(900), camera(), 1, kPeriod);
  // In the middle of the organ's upper side.
  const Eigen::Vector2d at = in_picture({0.02, 0.01, half_thickness_m(ObjectKind::kLiver)});
  hand.point({1, {{1, at.x(), at.y(), 0}}});
  const Vector3 place_m = later(hand, 2)[0].position_m;
  EXPECT_LT((in_picture(place_m) - at).norm(), 0.002);
  // As far from the surface as a fingertip is thick; nodes are a centimetre from each other.
  EXPECT_GT(nearest_node_m(place_m), 0.6 * kFingertipMetres);
  EXPECT_LT(nearest_node_m(place_m), 2.2 * kFingertipMetres);
  // Pushed, it goes deeper on the same line.
  hand.point({2, {{1, at.x(), at.y(), 0.01}}});
  const Vector3 pushed_m = later(hand, 1)[0].position_m;
  EXPECT_LT((in_picture(pushed_m) - at).norm(), 0.002);
  EXPECT_NEAR((pushed_m - place_m).norm(), 0.01, 0.001);
}

TEST(PointerHand, AFingertipGoesBelowTheBorderAndKeepsItsDepthWhileDragged) {
  PointerHand hand(kept_body(900), camera(), 3, kPeriod);
  const Eigen::Vector2d below = in_picture({0, -0.046, -0.027});
  hand.point({1, {{0, below.x(), below.y(), 0}}});
  const std::vector<sim::Pose> poses = later(hand, 2);
  EXPECT_NEAR(poses[1].position_m.y(), -0.046, 0.002);
  EXPECT_NEAR(poses[1].position_m.z(), -0.027, 0.002);
  EXPECT_NEAR(poses[0].position_m.x(), -0.04, 0.002);
  EXPECT_NEAR(poses[2].position_m.x(), 0.04, 0.002);
  // Upwards in the picture over the organ: the depth stays that of where it came down.
  hand.point({2, {{0, below.x(), below.y() - 0.1, 0}}});
  const Vector3 dragged_m = later(hand, 1)[1].position_m;
  const Vector3 forward = -camera().to_view.row(2);
  EXPECT_NEAR(forward.dot(dragged_m - poses[1].position_m), 0, 0.0005);
  EXPECT_GT(dragged_m.z(), poses[1].position_m.z() + 0.01);
}

TEST(PointerHand, FingersThatNothingMovesTouchNothingAndComeBackTowardsTheEye) {
  PointerHand hand(kept_body(900), camera(), 5, kPeriod);
  for (const sim::Pose& pose : later(hand, 0.1)) EXPECT_GT(nearest_node_m(pose.position_m), 0.03);
  const Eigen::Vector2d below = in_picture({0, -0.046, -0.027});
  hand.point({1, {{2, below.x(), below.y(), 0}, {4, below.x() + 0.1, below.y(), 0}}});
  const std::vector<sim::Pose> down = later(hand, 1);
  EXPECT_LT(nearest_node_m(down[1].position_m), 0.03);
  EXPECT_GT(nearest_node_m(down[2].position_m), 0.03);
  hand.point({2, {{4, below.x() + 0.1, below.y(), 0}}});
  const std::vector<sim::Pose> one_up = later(hand, 1);
  EXPECT_GT(nearest_node_m(one_up[1].position_m), 0.03);
  EXPECT_LT(nearest_node_m(one_up[3].position_m), 0.03);
}

TEST(PointerHand, MovesAsAHandDoesWhateverPointersDo) {
  PointerHand hand(kept_body(900), camera(), 5, kPeriod);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> anywhere(-0.5, 1.5), push(-0.08, 0.08);
  std::vector<sim::Pose> before = later(hand, kPeriod);
  double fastest_m_s = 0;
  for (std::uint64_t number = 1; number <= 300; ++number) {
    PointerInput input{number, {}};
    for (std::size_t finger = 1; finger <= random() % 6; ++finger)
      input.pointers.push_back({finger, anywhere(random), anywhere(random), push(random)});
    hand.point(input);
    for (std::uint32_t step = 0; step < 1 + random() % 40; ++step) {
      const std::vector<sim::Pose> poses = later(hand, kPeriod);
      for (std::size_t i = 0; i < poses.size(); ++i) {
        ASSERT_TRUE(poses[i].sound());
        fastest_m_s = std::max(fastest_m_s, (poses[i].position_m - before[i].position_m).norm() / kPeriod);
      }
      before = poses;
    }
  }
  EXPECT_LE(fastest_m_s, PointerHand::kMostSpeedMetres * (1 + 1e-9));
  EXPECT_GT(fastest_m_s, 0.5 * PointerHand::kMostSpeedMetres);
}

TEST(PointerHand, RefusesInWordsWhatNoHandDoesAndGoesOn) {
  PointerHand hand(kept_body(900), camera(), 2, kPeriod);
  hand.point({5, {}});
  const auto refused = [&](std::uint64_t number, std::vector<Pointer> pointers) {
    return refusal([&] { hand.point({number, std::move(pointers)}); });
  };
  EXPECT_THAT(refused(5, {}), HasSubstr("numbers must rise"));
  EXPECT_THAT(refused(6, {{3, 0.5, 0.5, 0}}), HasSubstr("no finger 3"));
  EXPECT_THAT(refused(6, {{1, 0.5, 0.5, 0}, {1, 0.4, 0.5, 0}}), HasSubstr("more than one"));
  EXPECT_THAT(refused(6, {{0, 0.5, 0.5, 0}, {1, 0.4, 0.5, 0}}), HasSubstr("more than one"));
  EXPECT_THAT(refused(6, {{1, 0.5, 0.5, 0}, {0, 0.4, 0.5, 0}}), HasSubstr("own"));
  EXPECT_THAT(refused(6, {{1, 7, 0.5, 0}}), HasSubstr("far outside"));
  EXPECT_THAT(refused(6, {{1, std::numeric_limits<double>::quiet_NaN(), 0.5, 0}}), HasSubstr("far outside"));
  EXPECT_THAT(refused(6, {{1, 0.5, 0.5, std::numeric_limits<double>::infinity()}}), HasSubstr("8 cm"));
  EXPECT_NO_THROW(hand.point({6, {{1, 0.5, 0.5, 0}}}));
  EXPECT_THROW(PointerHand(kept_body(900), camera(), 6, kPeriod), UsageError);
}

TEST(PointerHand, KnowsWhichInputWasFeltWhen) {
  PointerHand hand(kept_body(900), camera(), 1, kPeriod);
  later(hand, 0.01);
  EXPECT_EQ(hand.felt_by(PointerHand::Clock::now()), 0U);
  const auto before = PointerHand::Clock::now();
  hand.point({3, {{1, 0.5, 0.9, 0}}});
  later(hand, 0.01);
  EXPECT_EQ(hand.felt_by(before), 0U);
  EXPECT_EQ(hand.felt_by(PointerHand::Clock::now()), 3U);
  EXPECT_GT(hand.input_to_force().longest().count(), 0);
  EXPECT_LT(hand.input_to_force().longest(), PointerHand::Clock::now() - before);
}

/// What one pointer does: comes down below the border, and is drawn upwards by a share of the picture.
void draw_upwards(PointerHand& hand, double time_s, std::size_t finger, double by) {
  const Eigen::Vector2d below = in_picture({0, -0.046, -0.03});
  const double share = std::clamp((time_s - 0.5) / 3, 0.0, 1.0);
  hand.point(
      {static_cast<std::uint64_t>(1 + time_s * 1000), {{finger, below.x(), below.y() - by * share, 0}}});
}

TEST(PointerHand, OnePointerLiftsTheBorderWithThreeFingersOrOne) {
  for (const std::size_t fingers : {3U, 1U}) {
    const ExclusionBody& body = kept_body(fingers == 1 ? 2000 : 900);
    ExclusionOptions options;
    options.picture_rate_hz = 20;
    options.width = 320;
    options.height = 240;
    options.most_s = 8;
    ExclusionRunner runner(body, options);
    PointerHand hand(body, camera(), fingers, 1 / options.force_rate_hz);
    const ExclusionOutcome outcome = runner.run_in_own_time(hand, [&](const ExclusionView& view) {
      hand.see(view.displacement_m);
      draw_upwards(hand, view.time_s, fingers == 1 ? 1 : 0, fingers == 1 ? 0.125 : 0.1);
      return true;
    });
    EXPECT_TRUE(outcome.score.done) << fingers << " fingers saw " << outcome.score.best_visible_share;
    EXPECT_EQ(outcome.faults.jumps, 0U);
    EXPECT_GT(outcome.score.peak_wrist_n, 0.5);
    EXPECT_LT(outcome.score.peak_force_n, 40);
  }
}

}  // namespace
}  // namespace kiroku::trainer

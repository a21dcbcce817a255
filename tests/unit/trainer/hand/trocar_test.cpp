#include "trainer/hand/trocar.h"

#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/eventually.h"
#include "tests/unit/trainer/made_object.h"
#include "trainer/exclusion/hand_forces.h"
#include "trainer/exclusion/simulated_trainee.h"

namespace kiroku::trainer {
namespace {

using sim::Pose;
using sim::Vector3;
constexpr double kPi = std::numbers::pi;

Eigen::Quaterniond turned(double rad, const Vector3& about) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(rad, about.normalized()));
}

/// In the wall z = 0, into the body along z.
const Trocar kStraight;
/// Anywhere, looking anywhere.
const Trocar kOblique{{{0.04, -0.2, 0.11}, turned(2.1, {1, -2, 0.5})}};

/// A handle outside the wall by `outside_m`, whose shaft goes along that direction in the trocar's frame.
Pose handle_at(const Trocar& trocar, double outside_m, const Vector3& direction, double roll_rad = 0) {
  const Vector3 along = direction.normalized();
  return {trocar.pose.from_tool(-outside_m * along),
          trocar.pose.orientation * Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), along) *
              turned(roll_rad, Vector3::UnitZ())};
}

TEST(Trocar, AHandleTellsDepthTiltsAndRoll) {
  const InstrumentPlace straight = instrument_at(kStraight, {{0, 0, -0.2}, turned(0.7, {0, 0, 1})});
  EXPECT_DOUBLE_EQ(straight.depth_m, kInstrumentMetres - 0.2);
  EXPECT_DOUBLE_EQ(straight.outside_m, 0.2);
  EXPECT_NEAR(straight.tilt_x_rad, 0, 1e-12);
  EXPECT_NEAR(straight.tilt_y_rad, 0, 1e-12);
  EXPECT_NEAR(straight.roll_rad, 0.7, 1e-12);

  for (const Trocar& trocar : {kStraight, kOblique}) {
    for (const double roll : {-3.0, -0.4, 0.0, 1.2, 3.1}) {
      const InstrumentPlace place =
          instrument_at(trocar, handle_at(trocar, 0.15, {std::tan(0.5), std::tan(-0.3), 1}, roll));
      EXPECT_NEAR(place.depth_m, kInstrumentMetres - 0.15, 1e-12);
      EXPECT_NEAR(place.tilt_x_rad, 0.5, 1e-12);
      EXPECT_NEAR(place.tilt_y_rad, -0.3, 1e-12);
      EXPECT_NEAR(place.roll_rad, roll, 1e-12);
    }
  }
}

/// Only the place of a handle says where its shaft goes: a hand that holds it askew turns it, no more.
TEST(Trocar, TheShaftAlwaysPassesTheTrocar) {
  const InstrumentShape shape(InstrumentTip::kJaws);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const auto any = [&] { return Vector3(normal(random), normal(random), normal(random)); };
  for (int i = 0; i < 200; ++i) {
    const Pose handle{kOblique.pose.position_m + 0.2 * any(), turned(3 * normal(random), any())};
    const InstrumentPlace place = instrument_at(kOblique, handle);
    ASSERT_TRUE(place.handle.sound());
    const Vector3 to_trocar = kOblique.pose.position_m - place.handle.position_m;
    EXPECT_LE(to_trocar.cross(place.along()).norm(), 1e-12);
    EXPECT_NEAR(to_trocar.dot(place.along()), place.outside_m, 1e-12);
    EXPECT_GE(place.outside_m, kLeastOutsideMetres);
    EXPECT_NEAR(place.depth_m + place.outside_m, kInstrumentMetres, 1e-12);
    const Vector3 inwards = kOblique.pose.orientation * Vector3::UnitZ();
    EXPECT_GE(place.along().dot(inwards), std::cos(kMostTiltRadians) - 1e-9);
    for (const Pose& part : {shape.tip_at(place), shape.shaft_at(place)}) {
      EXPECT_TRUE(part.sound());
      EXPECT_LE((kOblique.pose.position_m - part.position_m).cross(place.along()).norm(), 1e-12);
    }
  }
}

TEST(Trocar, AHandleThatNoInstrumentCanFollowIsDrawnBackAlongTheTrocarsAxis) {
  const auto at = [](const Vector3& handle_m) {
    return instrument_at(kStraight, {handle_m, Eigen::Quaterniond::Identity()});
  };
  // At the housing of the trocar, in its very point, and lying on the wall.
  EXPECT_DOUBLE_EQ(at({0, 0, -0.01}).outside_m, kLeastOutsideMetres);
  EXPECT_EQ(at(Vector3::Zero()).along(), Vector3::UnitZ());
  const InstrumentPlace flat = at({0.2, 0, -0.001});
  EXPECT_NEAR(flat.tilt_x_rad, -kMostTiltRadians, 1e-9);
  EXPECT_NEAR(flat.outside_m, 0.2 / std::sin(kMostTiltRadians), 1e-12);
  // Inside the body: as flat as may be, on the side that it is at.
  EXPECT_NEAR(at({0.2, 0, 0.1}).tilt_x_rad, -kMostTiltRadians, 1e-9);
  // Drawn out.
  EXPECT_NEAR(at({0, 0, -0.4}).depth_m, kInstrumentMetres - 0.4, 1e-12);
}

/// A hand in the trocar, in its housing, through the wall and inside the body: nowhere does the tip jump.
TEST(Trocar, ATipNeverJumpsHoweverTheHandPassesTheTrocar) {
  constexpr double kStepMetres = 1e-4, kMostTimes = 30;
  constexpr int kSteps = 1600;  // 16 cm, the trocar's neighbourhood in the middle
  std::vector<std::pair<Vector3, Vector3>> lines{{{0, 0, -0.002}, Vector3::UnitX()},
                                                 {{0, 0, 0.002}, Vector3::UnitX()},
                                                 {{0, 0, 0}, Vector3::UnitY()},
                                                 {{0, 0, 0}, Vector3::UnitZ()},
                                                 {{0.05, 0, 0}, Vector3::UnitZ()}};
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const auto any = [&] { return Vector3(normal(random), normal(random), normal(random)); };
  for (int i = 0; i < 40; ++i) lines.emplace_back(0.02 * any(), any().normalized());
  double most_times = 0;
  for (const Trocar& trocar : {kStraight, kOblique}) {
    for (const auto& [middle_m, way] : lines) {
      std::optional<Vector3> before_m;
      for (int step = -kSteps / 2; step <= kSteps / 2; ++step) {
        const Vector3 at_m = middle_m + step * kStepMetres * way;
        const InstrumentPlace place =
            instrument_at(trocar, {trocar.pose.from_tool(at_m), trocar.pose.orientation});
        const Vector3 end_m = trocar.pose.position_m + place.depth_m * place.along();
        if (before_m) most_times = std::max(most_times, (end_m - *before_m).norm() / kStepMetres);
        before_m = end_m;
      }
    }
  }
  EXPECT_LE(most_times, kMostTimes);
  EXPECT_GT(most_times, 5);  // it was where the lever is longest
}

/// The fulcrum: the tip goes against the hand, by depth over outside.
TEST(Trocar, TheTipMovesAgainstTheHand) {
  const InstrumentShape shape(InstrumentTip::kRetractor);
  constexpr double kOutside = 0.1, kStep = 1e-6;
  const auto tip_m = [&](const Vector3& moved_m) {
    const Pose handle{Vector3(0, 0, -kOutside) + moved_m, Eigen::Quaterniond::Identity()};
    return shape.tip_at(instrument_at(kStraight, handle)).position_m;
  };
  const double depth_m = tip_m(Vector3::Zero()).z();
  EXPECT_NEAR(depth_m, kInstrumentMetres - kOutside - 0.02,
              1e-12);  // a blade's middle is 2 cm behind its end
  for (const Vector3& across : {Vector3(1, 0, 0), Vector3(0, 1, 0)}) {
    const Vector3 moved = (tip_m(kStep * across) - tip_m(-kStep * across)) / (2 * kStep);
    EXPECT_LE((moved + depth_m / kOutside * across).norm(), 1e-6);
  }
  const Vector3 along = (tip_m({0, 0, kStep}) - tip_m({0, 0, -kStep})) / (2 * kStep);
  EXPECT_LE((along - Vector3::UnitZ()).norm(), 1e-6);
}

TEST(Trocar, TheHandFeelsTheTissueByTheLever) {
  // 11 cm outside, 22 cm inside: a force across the shaft at the tip's end is felt twice, the other way
  // round, and the wall bears three times as much.
  const InstrumentPlace place = instrument_at(kStraight, {{0, 0, -0.11}, Eigen::Quaterniond::Identity()});
  const Vector3 end_m(0, 0, place.depth_m);
  EXPECT_NEAR(place.depth_m, 0.22, 1e-12);
  const auto felt = [&](const Vector3& tissue_n, double seal_n = 0) {
    return levered(place, tissue_n, end_m.cross(tissue_n), seal_n);
  };
  const InstrumentForces across = felt({1, -2, 0});
  EXPECT_LE((across.handle_n - Vector3(-2, 4, 0)).norm(), 1e-12);
  EXPECT_LE((across.wall_n - Vector3(3, -6, 0)).norm(), 1e-12);
  EXPECT_LE(across.handle_nm.norm(), 1e-12);
  // Along the shaft it is felt as it is, and the wall bears nothing but the seal's friction.
  const InstrumentForces along = felt({0, 0, -5}, -1.5);
  EXPECT_LE((along.handle_n - Vector3(0, 0, -6.5)).norm(), 1e-12);
  EXPECT_LE((along.wall_n - Vector3(0, 0, 1.5)).norm(), 1e-12);
  // Beside the shaft's axis it turns the handle.
  const InstrumentForces beside = levered(place, {0, 3, 0}, Vector3(0.01, 0, 0.22).cross(Vector3(0, 3, 0)));
  EXPECT_LE((beside.handle_nm - Vector3(0, 0, 0.03)).norm(), 1e-12);
  EXPECT_LE((beside.handle_n - Vector3(0, -6, 0)).norm(), 1e-12);
}

/// Any forces at any places of any instrument: what acts on it is in balance about any point.
TEST(Trocar, TissueHandAndWallAreInBalance) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const auto any = [&] { return Vector3(normal(random), normal(random), normal(random)); };
  for (int i = 0; i < 100; ++i) {
    const Pose handle = handle_at(kOblique, 0.05 + 0.2 * std::abs(std::sin(i)),
                                  {0.8 * std::sin(3 * i), 0.8 * std::cos(5 * i), 1}, normal(random));
    const InstrumentPlace place = instrument_at(kOblique, handle);
    const Vector3& pivot_m = kOblique.pose.position_m;
    const Vector3 tip_m = pivot_m + place.depth_m * place.along(), shaft_m = pivot_m + 0.03 * place.along();
    const Vector3 tip_n = any(), shaft_n = any(), tip_nm = 0.05 * any();
    const double seal_n = normal(random);
    const InstrumentForces forces =
        levered(place, tip_n + shaft_n,
                (tip_m - pivot_m).cross(tip_n) + (shaft_m - pivot_m).cross(shaft_n) + tip_nm, seal_n);
    // On the instrument: the tissue, and what answers what it does to hand and wall.
    const Vector3 hand_n = -forces.handle_n, wall_n = -forces.wall_n, hand_nm = -forces.handle_nm;
    const Vector3 about_m = any();
    EXPECT_LE(
        ((tip_m - about_m).cross(tip_n) + (shaft_m - about_m).cross(shaft_n) + tip_nm +
         (place.handle.position_m - about_m).cross(hand_n) + hand_nm + (pivot_m - about_m).cross(wall_n))
            .norm(),
        1e-12);
    // Along the shaft the wall does nothing but rub.
    EXPECT_NEAR(wall_n.dot(place.along()), seal_n, 1e-12);
  }
}

/// The lever loses and makes no work: what the hand does is done to the tissue, for each freedom.
TEST(Trocar, TheHandsWorkIsTheTipsWork) {
  const InstrumentShape shape(InstrumentTip::kRetractor);
  const Pose handle = handle_at(kOblique, 0.12, {0.4, -0.25, 1}, 0.6);
  const InstrumentPlace place = instrument_at(kOblique, handle);
  const Vector3 corner_m(0.01, 0.0025, 0.02), tissue_n(1.3, -0.7, 2.1);  // a corner of the blade
  const auto corner_at = [&](const Pose& moved) {
    return shape.tip_at(instrument_at(kOblique, moved)).from_tool(corner_m);
  };
  const Vector3 pivot_m = kOblique.pose.position_m;
  const InstrumentForces forces = levered(place, tissue_n, (corner_at(handle) - pivot_m).cross(tissue_n));
  constexpr double kStep = 1e-6;
  const auto tissue_work = [&](const Pose& forth, const Pose& back) {
    return tissue_n.dot(corner_at(forth) - corner_at(back)) / (2 * kStep);
  };
  const Vector3 along = place.along();
  const auto moved = [&](const Vector3& by_m) {
    // The handle stays along its shaft, so that nothing but the shaft's direction turns.
    const Vector3 now_along = (pivot_m - handle.position_m - by_m).normalized();
    return Pose{handle.position_m + by_m,
                (Eigen::Quaterniond::FromTwoVectors(along, now_along) * handle.orientation).normalized()};
  };
  for (const Vector3& way : {Vector3(1, 0, 0), Vector3(0, 1, 0), Vector3(0, 0, 1)}) {
    const Pose forth = moved(kStep * way), back = moved(-kStep * way);
    EXPECT_NEAR(tissue_work(forth, back), forces.handle_n.dot(way), 1e-6);
  }
  const auto rolled = [&](double by_rad) {
    return Pose{handle.position_m, handle.orientation * turned(by_rad, Vector3::UnitZ())};
  };
  EXPECT_NEAR(tissue_work(rolled(kStep), rolled(-kStep)), forces.handle_nm.dot(along), 1e-6);
}

TEST(Trocar, ItsSealGivesThenSlidesAndNeverPushesByItself) {
  SealFriction seal(2);
  EXPECT_EQ(seal.at(0.1), 0);
  EXPECT_NEAR(seal.at(0.1 + SealFriction::kGivesMetres / 2), -1, 1e-9);  // pushed in: held back
  EXPECT_NEAR(seal.at(0.1), 0, 1e-9);                                    // it gave, and came back
  EXPECT_DOUBLE_EQ(seal.at(0.12), -2);
  EXPECT_DOUBLE_EQ(seal.at(0.12), -2);  // it rests where it stuck
  EXPECT_DOUBLE_EQ(seal.at(0.11), 2);
  // Forth and back by 2 cm takes friction times way, less what gives at each turn: from full stretch on one
  // side to full stretch on the other, which takes no work in all.
  double work = 0, before_m = 0.11;
  for (int step = 1; step <= 40'000; ++step) {
    const double depth_m = 0.11 + 0.02 * (step <= 20'000 ? step : 40'000 - step) / 20'000;
    work -= seal.at(depth_m) * (depth_m - before_m);
    before_m = depth_m;
  }
  EXPECT_NEAR(work, 2 * 2 * (0.02 - 2 * SealFriction::kGivesMetres), 1e-4);
  EXPECT_EQ(seal.at(-0.01), 0);  // drawn out
  EXPECT_EQ(seal.at(0.05), 0);   // in again
  EXPECT_EQ(SealFriction(0).at(0.3), 0);
  EXPECT_THROW(SealFriction(-1), UsageError);
  EXPECT_THROW(SealFriction(std::nan("")), UsageError);
  EXPECT_THROW(SealFriction(kMostSealFrictionNewtons + 1), UsageError);
}

TEST(Trocar, ItsInstrumentEndsAtItsLengthAndHasNoGap) {
  const InstrumentPlace place = instrument_at(kStraight, {{0, 0, -0.13}, Eigen::Quaterniond::Identity()});
  const InstrumentShape blade(InstrumentTip::kRetractor), jaws(InstrumentTip::kJaws);
  const auto ends_m = [](const sim::ContactTool& tool, const Pose& pose) {
    if (const auto* box = std::get_if<sim::Box>(&tool.shape)) {
      return std::pair(pose.position_m.z() - box->half_extent_m.z(),
                       pose.position_m.z() + box->half_extent_m.z());
    }
    const auto& rod = std::get<sim::Capsule>(tool.shape);
    const double half_m = rod.half_length_m + rod.radius_m;
    return std::pair(pose.position_m.z() - half_m, pose.position_m.z() + half_m);
  };
  for (const InstrumentShape& shape : {blade, jaws}) {
    const auto [tip_from, tip_to] = ends_m(shape.tips(1, 0.5).front(), shape.tip_at(place));
    const auto [shaft_from, shaft_to] = ends_m(shape.shafts(1, 0.5).front(), shape.shaft_at(place));
    EXPECT_NEAR(tip_to, place.depth_m, 1e-12);
    EXPECT_NEAR(shaft_to, tip_from, 1e-12);
    EXPECT_NEAR(shaft_from, place.handle.position_m.z(), 1e-12);
  }
  EXPECT_TRUE(blade.tips(2, 0.5)[1].slides());
  EXPECT_EQ(blade.tips(2, 0.5)[1].name, "tip of instrument 2");
  EXPECT_FALSE(blade.shafts(2, 0)[1].sticks);
  EXPECT_THROW(instrument_tip_of("scissors"), UsageError);
  EXPECT_EQ(instrument_tip_of("jaws"), InstrumentTip::kJaws);
}

/// Gives the same poses again and again.
class StillTips : public sim::HapticDevice {
 public:
  explicit StillTips(std::vector<Pose> tips) : tips_(std::move(tips)) {}
  [[nodiscard]] std::size_t tools() const override { return tips_.size(); }
  bool read(std::span<Pose> poses) override {
    std::ranges::copy(tips_, poses.begin());
    return true;
  }
  void write(std::span<const Vector3> forces_n) override { given_n.assign(forces_n.begin(), forces_n.end()); }
  std::vector<Vector3> given_n;

 private:
  std::vector<Pose> tips_;
};

TEST(HandlesOfTips, BringTipsWhereTheyAreToBe) {
  const ExclusionTask task = exclusion_task(ObjectKind::kLiver);
  for (const InstrumentTip tip : {InstrumentTip::kRetractor, InstrumentTip::kJaws}) {
    const InstrumentShape shape(tip);
    const std::vector<Trocar> trocars = trocars_of(task, 2);
    const std::vector<Pose> wanted{{task.under_border_m + Vector3(-0.03, 0.01, 0.02), {}},
                                   {task.under_border_m + Vector3(0.05, 0, -0.01), {}}};
    StillTips tips(wanted);
    HandlesOfTips handles(tips, trocars, shape);
    std::vector<Pose> poses(2);
    ASSERT_TRUE(handles.read(poses));
    for (std::size_t i = 0; i < 2; ++i) {
      const InstrumentPlace place = instrument_at(trocars[i], poses[i]);
      EXPECT_LE((shape.tip_at(place).position_m - wanted[i].position_m).norm(), 1e-12);
      EXPECT_NEAR(place.roll_rad, 0, 1e-12);
    }
    const std::vector<Vector3> forces_n{{1, 2, 3}, {4, 5, 6}};
    handles.write(forces_n);
    EXPECT_EQ(tips.given_n, forces_n);
    EXPECT_THROW(HandlesOfTips(tips, trocars_of(task, 3), shape), UsageError);
  }
}

/// The wall is on the trainee's side, and instruments reach the organ past its border from below.
TEST(Trocar, TrocarsOfATaskLieBeforeTheOrgan) {
  const ExclusionTask task = exclusion_task(ObjectKind::kLiver);
  for (std::size_t count = 1; count <= kMostExclusionFingers; ++count) {
    const std::vector<Trocar> trocars = trocars_of(task, count);
    ASSERT_EQ(trocars.size(), count);
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_TRUE(trocars[i].pose.sound());
      const Vector3 to_border_m =
          task.under_border_m + side_by_side_m(count)[i] * task.aside - trocars[i].pose.position_m;
      EXPECT_NEAR(to_border_m.dot(task.away()), 0.12, 1e-12);
      EXPECT_LE((trocars[i].pose.orientation * Vector3::UnitZ() - to_border_m.normalized()).norm(), 1e-12);
      EXPECT_GT((trocars[i].pose.orientation * Vector3::UnitX()).dot(task.aside), 0.5);
      EXPECT_LT((trocars[i].pose.orientation * Vector3::UnitY()).dot(task.lifts), -0.5);
      if (i == 0) continue;
      EXPECT_NEAR((trocars[i].pose.position_m - trocars[i - 1].pose.position_m).norm(), 0.06, 1e-12);
    }
  }
  EXPECT_THROW(trocars_of(task, 0), UsageError);
  EXPECT_THROW(trocars_of(task, 6), UsageError);
}

class InstrumentForcesOnAnOrgan : public testing::Test {
 protected:
  InstrumentForcesOnAnOrgan()
      : body(made_object(ObjectKind::kLiver, 900), exclusion_task(ObjectKind::kLiver)) {}

  /// Lifts the border by 8 mm with the tips of two instruments.
  HandForces::State lift(HandForces& forces, InstrumentTip tip, std::vector<Vector3>& played_n) {
    const InstrumentShape shape(tip);
    const std::vector<Trocar> trocars = trocars_of(body.task(), 2);
    std::vector<Pose> poses(2);
    for (int step = 0; step <= 50; ++step) {
      for (std::size_t i = 0; i < 2; ++i) {
        const Vector3 tip_m = body.task().under_border_m + side_by_side_m(2)[i] * body.task().aside +
                              (1.6e-4 * step) * body.task().lifts;
        poses[i] = shape.handle_for(trocars[i], tip_m);
      }
      EXPECT_TRUE(test::eventually([&] {
        forces.forces(poses, 1e-3, played_n);
        const sim::HapticContact::Deformation found = forces.refresh();
        return found.nodes_known > 0 && found.nodes_awaited == 0;
      }));
    }
    for (int step = 0; step < 60; ++step) forces.forces(poses, 1e-3, played_n);
    return forces.state();
  }

  ExclusionBody body;
};

TEST_F(InstrumentForcesOnAnOrgan, HandleAndWallBearWhatTheTissueDoes) {
  for (const InstrumentTip tip : {InstrumentTip::kRetractor, InstrumentTip::kJaws}) {
    HandForces forces(body, 2, Feedback::kFull, Touch::kTrocar, {tip, 0});
    std::vector<Vector3> played_n(2);
    const HandForces::State state = lift(forces, tip, played_n);
    ASSERT_EQ(state.instruments.size(), 2U);
    const std::vector<Trocar> trocars = trocars_of(body.task(), 2);
    Vector3 handles_n = Vector3::Zero(), handles_nm = Vector3::Zero();
    const Vector3 wrist_m(0.02, -0.3, -0.1);
    for (std::size_t i = 0; i < 2; ++i) {
      const InstrumentForces& on = state.instruments[i].forces;
      const InstrumentPlace& place = state.instruments[i].place;
      EXPECT_EQ(played_n[i], on.handle_n);
      EXPECT_EQ(state.forces_n[i], on.tissue_n);
      EXPECT_LT(on.tissue_n.dot(body.task().lifts), -0.05);  // the organ lies on the tip
      EXPECT_GT(on.handle_n.dot(body.task().lifts), 0.05);   // and presses the handle up
      // The force across the shaft acts somewhere within the tip, or on the shaft before it: so the lever's
      // arm lies between trocar and the tip's end.
      const Vector3 along = place.along();
      const Vector3 across_n = on.tissue_n - on.tissue_n.dot(along) * along,
                    felt_n = on.handle_n - on.handle_n.dot(along) * along;
      EXPECT_LT(felt_n.dot(across_n), 0);
      const double arm_m = place.outside_m * felt_n.norm() / across_n.norm();
      EXPECT_GT(arm_m, place.depth_m - 0.06);
      EXPECT_LT(arm_m, place.depth_m + 0.001);
      handles_n += on.handle_n;
      handles_nm += (place.handle.position_m - wrist_m).cross(on.handle_n) + on.handle_nm;
      EXPECT_LE((place.handle.position_m + place.outside_m * along - trocars[i].pose.position_m).norm(),
                1e-12);
    }
    const sim::WristForce wrist = forces.wrist_force(wrist_m);
    EXPECT_LE((wrist.force_n - handles_n).norm(), 1e-12);
    EXPECT_LE((wrist.torque_nm - handles_nm).norm(), 1e-12);
    EXPECT_LE((state.wrist_n - handles_n).norm(), 1e-12);
    EXPECT_GT(state.peak_wall_n, state.peak_force_n);
  }
}

/// The tissue's torque about the trocar, from the nodes themselves: neither from tools nor from levers.
TEST_F(InstrumentForcesOnAnOrgan, TheContactsOfTheTissueAreInBalanceWithHandAndWall) {
  HandForces forces(body, 2, Feedback::kFull, Touch::kTrocar, {InstrumentTip::kRetractor, 0});
  std::vector<Vector3> played_n(2);
  const HandForces::State state = lift(forces, InstrumentTip::kRetractor, played_n);
  const sim::HapticContact::Deformation deformed = forces.refresh();
  for (std::size_t i = 0; i < 2; ++i) {
    const InstrumentForces& on = state.instruments[i].forces;
    const InstrumentPlace& place = state.instruments[i].place;
    const Vector3 about_m(0.1, 0.2, -0.3);
    Vector3 sum_n = -on.handle_n - on.wall_n;
    Vector3 sum_nm = -(place.handle.position_m - about_m).cross(on.handle_n) - on.handle_nm -
                     (place.handle.position_m + place.outside_m * place.along() - about_m).cross(on.wall_n);
    double pressed_n = 0;
    for (const sim::Contact& contact : deformed.contacts) {
      if (contact.tool != i && contact.tool != 2 + i) continue;
      const Vector3 node_m =
          body.object().mesh.nodes[contact.node] +
          deformed.displacement_m.segment<3>(static_cast<Eigen::Index>(3 * std::size_t{contact.node}));
      sum_n -= contact.force_n;  // of the tissue on the instrument
      sum_nm -= (node_m - about_m).cross(contact.force_n);
      pressed_n += contact.force_n.norm();
    }
    EXPECT_GT(pressed_n, 0.05);
    EXPECT_LE(sum_n.norm(), 1e-9 * pressed_n);
    EXPECT_LE(sum_nm.norm(), 1e-6 * pressed_n);
  }
}

TEST_F(InstrumentForcesOnAnOrgan, ASealRubsOnTheHandAndTheWallAlone) {
  HandForces smooth(body, 1, Feedback::kFull, Touch::kTrocar),
      rubbing(body, 1, Feedback::kFull, Touch::kTrocar, {InstrumentTip::kRetractor, 1.5});
  const Trocar trocar = trocars_of(body.task(), 1).front();
  std::vector<Vector3> smooth_n(1), rubbing_n(1);
  for (int step = 0; step < 20; ++step) {
    const std::vector<Pose> poses{
        handle_at(trocar, 0.28 - 1e-3 * step, {0, 0, 1})};  // pushed in, in the free
    smooth.forces(poses, 1e-3, smooth_n);
    rubbing.forces(poses, 1e-3, rubbing_n);
  }
  EXPECT_EQ(smooth_n[0], Vector3::Zero());
  const Vector3 inwards = trocar.pose.orientation * Vector3::UnitZ();
  EXPECT_LE((rubbing_n[0] + 1.5 * inwards).norm(), 1e-9);  // against the hand that pushes
  const HandForces::State state = rubbing.state();
  EXPECT_EQ(state.forces_n[0], Vector3::Zero());
  EXPECT_LE((state.instruments[0].forces.wall_n - 1.5 * inwards).norm(), 1e-9);
  EXPECT_NEAR(state.peak_wall_n, 1.5, 1e-9);
  EXPECT_EQ(state.peak_force_n, 0);
}

TEST(TouchNames, AreThoseOfTheCommand) {
  EXPECT_EQ(touch_of("trocar"), Touch::kTrocar);
  EXPECT_EQ(touch_of("hand"), Touch::kHand);
  EXPECT_THROW(touch_of("stick"), UsageError);
}

}  // namespace
}  // namespace kiroku::trainer

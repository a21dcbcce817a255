// Handles that pointers lead by the tips never jump, and bring the tips where pointers are.
#include "trainer/exclusion/pointer_instruments.h"

#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "base/error.h"
#include "trainer/exclusion/exclusion_body.h"

namespace kiroku::trainer {
namespace {

using sim::Pose;
using sim::Vector3;

constexpr double kStepSeconds = 1e-3;

/// A device that has the ends of tips where the test puts them.
class LedTips : public sim::HapticDevice {
 public:
  explicit LedTips(std::vector<Vector3> places_m) : places_m_(std::move(places_m)) {}
  [[nodiscard]] std::size_t tools() const override { return places_m_.size(); }
  bool read(std::span<Pose> poses) override {
    for (std::size_t i = 0; i < poses.size(); ++i) poses[i] = {places_m_[i], Eigen::Quaterniond::Identity()};
    return true;
  }
  void write(std::span<const Vector3> forces_n) override { felt_n.assign(forces_n.begin(), forces_n.end()); }
  void put(std::size_t i, const Vector3& place_m) { places_m_[i] = place_m; }
  std::vector<Vector3> felt_n;

 private:
  std::vector<Vector3> places_m_;
};

class PointerInstrumentsTest : public testing::Test {
 protected:
  PointerInstrumentsTest() : trocars(trocars_of(exclusion_task(ObjectKind::kLiver), 2)) {
    for (const Trocar& trocar : trocars) before_the_wall.push_back(trocar.pose.from_tool({0, 0, 0.12}));
  }
  /// Of the instrument with that handle.
  Vector3 end_m(std::size_t i, const Pose& handle) const {
    const InstrumentPlace place = instrument_at(trocars[i], handle);
    return trocars[i].pose.position_m + place.depth_m * place.along();
  }
  std::vector<Trocar> trocars;
  std::vector<Vector3> before_the_wall;
};

TEST_F(PointerInstrumentsTest, BringTipsWhereTheyAreLed) {
  LedTips tips(before_the_wall);
  PointerInstruments instruments(tips, trocars, kStepSeconds);
  ASSERT_EQ(instruments.tools(), 2U);
  std::vector<Pose> handles(2);
  ASSERT_TRUE(instruments.read(handles));
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_LT((end_m(i, handles[i]) - before_the_wall[i]).norm(), 1e-12) << i;
  // Five centimetres aside: not at once, but soon.
  const Vector3 aside_m = before_the_wall[0] + trocars[0].pose.orientation * Vector3(0.05, 0, 0);
  tips.put(0, aside_m);
  ASSERT_TRUE(instruments.read(handles));
  EXPECT_GT((end_m(0, handles[0]) - aside_m).norm(), 0.04);
  for (int step = 0; step < 100; ++step) ASSERT_TRUE(instruments.read(handles));
  EXPECT_LT((end_m(0, handles[0]) - aside_m).norm(), 1e-12);
  EXPECT_LT((end_m(1, handles[1]) - before_the_wall[1]).norm(), 1e-12);
  const std::vector<Vector3> forces_n{{1, 2, 3}, {4, 5, 6}};
  instruments.write(forces_n);
  EXPECT_EQ(tips.felt_n, forces_n);
}

/// Through the trocar, behind the wall, far aside, deeper than the instrument is long, and in the very point.
TEST_F(PointerInstrumentsTest, AHandleIsNoFasterThanAHandWhereverItsTipIsLed) {
  LedTips tips(before_the_wall);
  PointerInstruments instruments(tips, trocars, kStepSeconds);
  std::vector<Pose> handles(2), before(2);
  ASSERT_TRUE(instruments.read(before));
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  double fastest_m = 0;
  for (int goal = 0; goal < 200; ++goal) {
    const Vector3 place_m(0.15 * normal(random), 0.15 * normal(random), 0.15 + 0.2 * normal(random));
    tips.put(0, goal % 10 == 0 ? trocars[0].pose.position_m : trocars[0].pose.from_tool(place_m));
    for (int step = 0; step < 50; ++step) {
      ASSERT_TRUE(instruments.read(handles));
      ASSERT_TRUE(handles[0].sound());
      fastest_m = std::max(fastest_m, (handles[0].position_m - before[0].position_m).norm());
      // Each is the handle of an instrument that lies in its trocar.
      const Pose lies = instrument_at(trocars[0], handles[0]).handle;
      ASSERT_LT((lies.position_m - handles[0].position_m).norm(), 1e-9);
      before = handles;
    }
  }
  EXPECT_LE(fastest_m, PointerInstruments::kMostHandleSpeedMetres * kStepSeconds * (1 + 1e-9));
  EXPECT_GT(fastest_m, 0.9 * PointerInstruments::kMostHandleSpeedMetres * kStepSeconds);
}

TEST_F(PointerInstrumentsTest, NeedATrocarEach) {
  LedTips tips({before_the_wall[0]});
  EXPECT_THROW(PointerInstruments(tips, trocars, kStepSeconds), UsageError);
}

}  // namespace
}  // namespace kiroku::trainer

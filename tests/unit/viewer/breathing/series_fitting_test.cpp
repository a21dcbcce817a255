// The workbench's fit: from the sliders to the motion that made the radiographs, and to where the tumour is
// seen; what explains nothing is refused; a fit that is not wanted ends.
#include "viewer/breathing/series_fitting.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/eventually.h"
#include "tests/unit/viewer/breathing/chest_bench.h"
#include "viewer/breathing/breathing_room.h"
#include "viewer/breathing/breathing_table.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr std::size_t kMoments = 16;

const auto kUnheard = [](const std::string& /*doing*/, std::size_t /*done*/, std::size_t /*all*/) {};

class SeriesFitting : public testing::Test {
 protected:
  test::ChestBench chest_;
};

TEST_F(SeriesFitting, FindsTheMotionFromTheSlidersAndSeesTheTumour) {
  const BreathingBench bench(chest_.inputs_with_radiographs(kMoments));
  ASSERT_TRUE(bench.can_fit());
  const sim::BreathingMotion& truth = chest_.truth().motion;
  FitDeed deed{bench.own_motion(), true};
  deed.start.motion.diaphragm = {0.004, 3.5, sim::Vector3(0, 0, -1), 0, 0};
  deed.start.cycle_s = 3.2;
  const FittedSeries fitted = fit_to_radiographs(bench, deed, kUnheard);
  ASSERT_EQ(fitted.fit.refusal, "");
  const sim::GroupMotion& diaphragm = fitted.motion.motion.diaphragm;
  EXPECT_NEAR(diaphragm.amplitude_m, truth.diaphragm.amplitude_m, 0.001);
  EXPECT_NEAR(diaphragm.phase_s, truth.diaphragm.phase_s + 3.6, 0.1) << "nearest to where it was";
  // One view shows the direction across its rays alone.
  EXPECT_LT(diaphragm.direction->z(), -0.9);
  EXPECT_NEAR(*fitted.motion.cycle_s, 3.6, 0.05);
  EXPECT_GT(fitted.fit.diaphragm.amplitude_error_m, 0);
  EXPECT_LT(fitted.fit.diaphragm.amplitude_error_m, 0.001);
  // The motion is one of the page's: pictures of it are more like the radiographs than those of the start.
  BreathingTable table(bench);
  const auto mean_similarity = [&](const MotionDeed& motion) {
    table.apply(motion);
    double sum = 0;
    while (table.measure_one()) {
    }
    for (const auto& one : table.similarities()) sum += *one / double(kMoments);
    return sum;
  };
  const double before = mean_similarity(deed.start), after = mean_similarity(fitted.motion);
  EXPECT_GT(after, 0.995);
  EXPECT_GT(after, before + 0.01);
  // Where it is seen it is, but for its depth.
  ASSERT_EQ(fitted.tumour.size(), kMoments);
  table.apply(MotionDeed{truth, 3.6});
  const sim::TumourPath path = table.path();
  std::size_t seen = 0;
  for (std::size_t i = 0; i < kMoments; ++i) {
    if (!fitted.tumour[i]) continue;
    ++seen;
    const sim::Vector3 off_m = path.centres_m[i] - path.rest_m - fitted.tumour[i]->place_m;
    EXPECT_LT(std::hypot(off_m.x(), off_m.z()), 0.0015) << i;
    EXPECT_GT(fitted.tumour[i]->error_m.minCoeff(), 0);
  }
  EXPECT_GE(seen, kMoments - 4);
}

TEST_F(SeriesFitting, RefusesWithItsNumbersWhatExplainsNothing) {
  BenchInputs inputs = chest_.inputs_with_radiographs(kMoments);
  for (BenchRadiograph& one : inputs.radiographs) one.image = inputs.radiographs.front().image;
  const BreathingBench bench(std::move(inputs));
  const FittedSeries fitted = fit_to_radiographs(bench, {bench.own_motion(), false}, kUnheard);
  EXPECT_THAT(fitted.fit.refusal, AllOf(HasSubstr("no breathing was found"), HasSubstr("by chance")));
  EXPECT_TRUE(fitted.tumour.empty());
  const BreathingBench few(chest_.inputs_with_radiographs(6));
  EXPECT_FALSE(few.can_fit());
  EXPECT_THROW(static_cast<void>(fit_to_radiographs(few, {few.own_motion(), false}, kUnheard)), Error);
}

TEST_F(SeriesFitting, OneIsComputedAtATimeAndEndsWhenItIsNotWanted) {
  const BreathingBench bench(chest_.inputs_with_radiographs(kMoments));
  BreathingRoom room(bench, 4, [](const std::string& /*sentence*/) {});
  std::atomic<int> parts = 0, ends = 0;
  std::atomic<bool> goes_on = false;
  std::string sentence;
  BackgroundFit::Listener listener;
  listener.progress = [&](const std::string& /*doing*/, std::size_t /*done*/, std::size_t /*all*/) {
    ++parts;
    EXPECT_TRUE(test::eventually([&] { return goes_on.load(); }));
  };
  listener.fitted = [](const FittedSeries& /*fitted*/) { ADD_FAILURE() << "it was cancelled"; };
  listener.ended = [&](const std::string& why) {
    sentence = why;
    ++ends;
  };
  BackgroundFit fit(bench, {bench.own_motion(), false}, room.enter_fit("anna"), listener);
  ASSERT_TRUE(test::eventually([&] { return parts == 1; }));
  EXPECT_THROW(static_cast<void>(room.enter_fit("anna")), Refusal);
  EXPECT_THROW(static_cast<void>(room.enter_fit("otto")), Refusal);
  EXPECT_FALSE(fit.over());
  fit.cancel();
  goes_on = true;
  ASSERT_TRUE(test::eventually([&] { return ends == 1; }));
  EXPECT_EQ(parts, 1);
  EXPECT_THAT(sentence, HasSubstr("was cancelled"));
  EXPECT_TRUE(fit.over());
  EXPECT_NO_THROW(static_cast<void>(room.enter_fit("otto"))) << "the place is free again";
}

}  // namespace
}  // namespace kiroku::viewer

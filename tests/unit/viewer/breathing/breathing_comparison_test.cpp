// A planned breath beside radiographs of the real one: what was as planned is told so, what was not with how
// far it was off; what explains nothing is not compared.
#include "viewer/breathing/breathing_comparison.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "tests/unit/viewer/breathing/chest_bench.h"

namespace kiroku::viewer {
namespace {

using testing::HasSubstr;

constexpr std::size_t kCompared = 16;

const auto kNobodyHears = [](const std::string& /*doing*/, std::size_t /*done*/, std::size_t /*all*/) {};

class BreathingComparisonTest : public testing::Test {
 protected:
  /// Radiographs of the truth, and a plan of this motion.
  [[nodiscard]] BreathingBench bench_of(const sim::BreathingMotion& planned) const {
    BenchInputs inputs = chest_.inputs_with_radiographs(kCompared);
    inputs.model.motion = planned;
    return BreathingBench(std::move(inputs));
  }
  [[nodiscard]] const sim::BreathingMotion& truth() const { return chest_.truth().motion; }

  test::ChestBench chest_;
};

TEST_F(BreathingComparisonTest, ABreathAsPlannedIsFoundSoWheneverItBegan) {
  // The plan's clock is another than the recording's.
  sim::BreathingMotion planned = truth();
  planned.rib_cage.phase_s -= 1.3;
  planned.diaphragm.phase_s -= 1.3;
  const BreathingBench bench = bench_of(planned);
  const BreathingComparison comparison = compare_breathing(bench, kNobodyHears);
  EXPECT_NEAR(comparison.start_s, 1.3, 0.1);
  EXPECT_NEAR(comparison.planned.motion.diaphragm.phase_s, truth().diaphragm.phase_s, 0.1);
  ASSERT_EQ(comparison.radiographs.size(), kCompared);
  EXPECT_GT(comparison.mean_similarity(), 0.995);
  const std::vector<double> off_m = comparison.distances_m();
  ASSERT_GE(off_m.size(), kCompared - 4);
  EXPECT_TRUE(std::ranges::is_sorted(off_m));
  EXPECT_LT(off_m.back(), 0.0015);
  EXPECT_LE(comparison.beyond_two(), 2U);
}

TEST_F(BreathingComparisonTest, ABreathThatWasDeeperThanPlannedIsToldWithItsError) {
  sim::BreathingMotion planned = truth();
  planned.diaphragm.amplitude_m = 0.001;
  const BreathingBench bench = bench_of(planned);
  const BreathingComparison comparison = compare_breathing(bench, kNobodyHears);
  EXPECT_NEAR(comparison.found.motion.motion.diaphragm.amplitude_m, truth().diaphragm.amplitude_m, 0.001);
  EXPECT_LT(comparison.start_s < 1.8 ? comparison.start_s : 3.6 - comparison.start_s, 0.15);
  EXPECT_LT(comparison.mean_similarity(), comparison.found.fit.similarity_after - 0.005);
  // Where it was seen is compared with the true paths, which no fit has touched.
  const sim::Waveform waveform{sim::SineWave{3.6}};
  std::size_t seen = 0;
  for (const ComparedRadiograph& one : comparison.radiographs) {
    if (!one.seen) continue;
    ++seen;
    const auto moved_m = [&](const sim::BreathingMotion& motion) {
      return bench.own_lung()->tumour.displacement_m(motion, waveform, one.time_s);
    };
    const sim::Vector3 apart_m = moved_m(truth()) - moved_m(planned);
    EXPECT_NEAR(one.off_m, std::hypot(apart_m.x(), apart_m.z()), 0.0004) << one.time_s;
    EXPECT_GT(one.off_error_m, 0);
  }
  EXPECT_GE(seen, kCompared - 4);
  EXPECT_GT(comparison.distances_m().back(), 0.0015);
  EXPECT_GE(comparison.beyond_two(), 3U);
  const nlohmann::ordered_json document = comparison_json(comparison);
  EXPECT_EQ(document["planned"]["diaphragm"]["amplitude_mm"], 1);
  EXPECT_NEAR(document["found"]["diaphragm"]["amplitude_mm"].get<double>(), 9, 1);
  EXPECT_GT(document["errors"]["diaphragm"]["amplitude_mm"], 0);
  EXPECT_EQ(document["tumour"]["seen"], seen);
  EXPECT_EQ(document["tumour"]["of"], kCompared);
  EXPECT_LE(document["tumour"]["mean_mm"], document["tumour"]["within_95_mm"]);
  EXPECT_LE(document["tumour"]["within_95_mm"], document["tumour"]["largest_mm"]);
  EXPECT_NEAR(document["tumour"]["largest_mm"].get<double>(), 1000 * comparison.distances_m().back(), 1e-9);
  EXPECT_EQ(document["radiographs"].size(), kCompared);
}

TEST_F(BreathingComparisonTest, WhatShowsNoBreathAndWhatHasNoBeginningIsNotCompared) {
  const auto refused = [](BenchInputs inputs) -> std::string {
    try {
      const BreathingBench bench(std::move(inputs));
      static_cast<void>(compare_breathing(bench, kNobodyHears));
    } catch (const Error& error) {
      return error.what();
    }
    return "compared";
  };
  BenchInputs still = chest_.inputs_with_radiographs(kCompared);
  for (BenchRadiograph& one : still.radiographs) one.image = still.radiographs.front().image;
  EXPECT_THAT(refused(std::move(still)), HasSubstr("nothing can be compared: no breathing was found"));
  BenchInputs measured = chest_.inputs_with_radiographs(kCompared);
  measured.model.waveform = sim::Waveform(std::vector<sim::Breath>{{3.4}, {3.8}});
  EXPECT_THAT(refused(std::move(measured)), HasSubstr("nothing says which of its moments"));
  EXPECT_THAT(refused(chest_.inputs_with_radiographs(6)), HasSubstr("8 at least"));
}

}  // namespace
}  // namespace kiroku::viewer

// The breathing workbench without a network: pictures, the tumour's path and measures against solves of their
// own; what is saved; what is refused.
#include "viewer/breathing/breathing_table.h"

#include <atomic>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/drr/registration.h"
#include "tests/support/eventually.h"
#include "tests/unit/viewer/breathing/chest_bench.h"
#include "viewer/breathing/live_breathing.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

using testing::Each;
using testing::HasSubstr;

template <typename Act>
std::string sentence_of(const Act& act) {
  try {
    act();
  } catch (const Error& error) {
    return error.what();
  }
  return "taken";
}

class BreathingTableTest : public testing::Test {
 protected:
  [[nodiscard]] static BreathingBench bench_of(BenchInputs inputs) {
    return BreathingBench(std::move(inputs));
  }
  [[nodiscard]] MotionDeed true_motion() const { return {chest_.truth().motion, 3.6}; }

  test::ChestBench chest_;
};

TEST(BreathingBenchMemory, ASeriesThatIsTooLargeIsRefusedBeforeItIsRead) {
  EXPECT_NO_THROW(BreathingBench::require_memory_for(BreathingBench::kMostRadiographBytes));
  EXPECT_THROW(BreathingBench::require_memory_for(BreathingBench::kMostRadiographBytes + 1), Error);
}

TEST_F(BreathingTableTest, TheTumoursPathIsThatOfSolvesOfItsOwn) {
  const BreathingBench bench = bench_of(chest_.inputs());
  BreathingTable table(bench);
  MotionDeed deed = true_motion();
  deed.cycle_s = 4;
  deed.motion.rib_cage.drift_m_per_s = 0.0001;
  table.apply(deed);
  const sim::BreathingModel& model = bench.model();
  const sim::BreathingBody body(model.mesh, model.materials, model.groups, model.slide);
  const sim::BreathingCycle cycle(body, deed.motion, sim::Waveform(sim::SineWave{4}));
  const sim::MeshPoint centre = sim::centre_of(model.mesh, *model.tumour);
  const sim::TumourPath path = table.path();
  ASSERT_EQ(path.times_s.size(), 12U);
  EXPECT_NEAR(path.times_s.back(), 4.0 * 11 / 12, 1e-12);
  EXPECT_EQ(table.duration_s(), 4);
  for (std::size_t i = 0; i < path.times_s.size(); ++i) {
    const sim::Vector3 expected_m = path.rest_m + centre.mean(cycle.displacement_m(path.times_s[i]));
    EXPECT_LT((path.centres_m[i] - expected_m).norm(), 1e-12);
  }
  EXPECT_GT(sim::excursion_m(path).z(), 0.001);
}

TEST_F(BreathingTableTest, RadiographsAreAsAlikeAsTheOverlayMeasuresThem) {
  const BreathingBench bench = bench_of(chest_.inputs_with_radiographs());
  BreathingTable table(bench);
  while (table.measure_one()) {
  }
  const std::vector<std::optional<double>> before = table.similarities();
  table.apply(true_motion());
  EXPECT_THAT(table.similarities(), Each(std::optional<double>())) << "of another motion nothing is known";
  table.apply(MomentDeed{bench.radiographs()[3].time_s});
  EXPECT_TRUE(table.measure_one());
  EXPECT_TRUE(table.similarities()[3]) << "the one that is looked at comes first";
  while (table.measure_one()) {
  }
  const std::vector<std::optional<double>>& after = table.similarities();
  for (std::size_t i = 0; i < after.size(); ++i) {
    EXPECT_GT(*after[i], 0.9999) << "the motion is the truth's";
    EXPECT_LT(*before[i], *after[i]);
  }
  // By a solve of its own.
  table.apply(bench.own_motion());
  while (table.measure_one()) {
  }
  const BenchInputs inputs = chest_.inputs();
  const sim::BreathingScene scene(inputs.model, inputs.volume);
  const double time_s = bench.radiographs()[2].time_s;
  sim::ProjectionImage drr =
      scene.moving(inputs.geometry, {inputs.model.motion.rib_cage.moved_m(inputs.model.waveform, time_s),
                                     inputs.model.motion.diaphragm.moved_m(inputs.model.waveform, time_s)});
  sim::add_to(drr, scene.still(inputs.geometry));
  EXPECT_NEAR(*table.similarities()[2], sim::gradient_correlation(bench.radiographs()[2].image, drr), 1e-6);
}

TEST_F(BreathingTableTest, ShowsBothAtTheSameMomentByItsModes) {
  const BreathingBench bench = bench_of(chest_.inputs_with_radiographs());
  BreathingTable table(bench);
  table.apply(true_motion());
  // Between two pictures the earlier is seen, with the lung of its moment.
  table.apply(MomentDeed{bench.radiographs()[2].time_s + 0.1});
  table.apply(LookDeed{sim::OverlayMode::kOpacity, 0, false});
  const BreathingTable::Shown radiograph = table.picture(1);
  EXPECT_EQ(radiograph.radiograph, 2U);
  EXPECT_EQ(radiograph.time_s, bench.radiographs()[2].time_s);
  table.apply(LookDeed{sim::OverlayMode::kOpacity, 1, false});
  const BreathingTable::Shown drr = table.picture(1);
  table.apply(LookDeed{sim::OverlayMode::kWipe, 0.25, false});
  const BreathingTable::Shown wiped = table.picture(1);
  const std::size_t columns = wiped.picture.columns;
  for (std::size_t at = 0; at < wiped.picture.pixels.size(); ++at) {
    ASSERT_EQ(wiped.picture.pixels[at], (at % columns < columns / 4 ? drr : radiograph).picture.pixels[at]);
  }
  // As the motion is the truth's, nothing is left of the difference; as another's, there is.
  const auto largest_difference = [&] {
    table.apply(LookDeed{sim::OverlayMode::kDifference, 0, false});
    int most = 0;
    for (const sim::Colour& pixel : table.picture(1).picture.pixels)
      most = std::max(most, std::abs(pixel[0] - 128));
    return most;
  };
  const int of_truth = largest_difference();
  table.apply(bench.own_motion());
  EXPECT_GT(largest_difference(), of_truth + 30);
  table.apply(LookDeed{sim::OverlayMode::kBeside, 0, true});
  EXPECT_EQ(table.picture(1).picture.columns, 256U);
  EXPECT_EQ(table.picture(2).picture.columns, 128U);
  // The outline lies on both.
  const sim::ColourPicture outlined = table.picture(1).picture;
  std::array<int, 2> yellow{};
  for (std::size_t at = 0; at < outlined.pixels.size(); ++at) {
    if (outlined.pixels[at][0] > outlined.pixels[at][2] + 60) ++yellow[at % 256 / 128];
  }
  EXPECT_GT(yellow[0], 20);
  EXPECT_EQ(yellow[0], yellow[1]);
}

TEST_F(BreathingTableTest, SavesWhatSimRespireTakesAndNeverOverAnother) {
  const BreathingBench bench = bench_of(chest_.inputs());
  EXPECT_EQ(bench.save("fitted", true_motion()), "fitted.json");
  const sim::BreathingModel saved = sim::read_breathing_model(chest_.folder() / "fitted.json");
  EXPECT_NEAR(saved.motion.diaphragm.amplitude_m, 0.009, 1e-15);
  EXPECT_NEAR(saved.motion.diaphragm.baseline_m, 0.001, 1e-15);
  EXPECT_LT((*saved.motion.diaphragm.direction - *chest_.truth().motion.diaphragm.direction).norm(), 1e-12);
  EXPECT_FALSE(saved.motion.rib_cage.direction);
  EXPECT_EQ(saved.waveform.duration_s(), 3.6);
  EXPECT_EQ(saved.tumour->tetrahedra, bench.model().tumour->tetrahedra);
  EXPECT_EQ(saved.phases, 12U);
  EXPECT_THAT(sentence_of([&] { static_cast<void>(bench.save("fitted", true_motion())); }),
              HasSubstr("there is a file 'fitted.json' already"));
  EXPECT_THAT(sentence_of([&] { static_cast<void>(bench.save("../fitted", true_motion())); }),
              HasSubstr("a model is saved under letters"));
  EXPECT_FALSE(std::filesystem::exists(chest_.folder().parent_path() / "fitted.json"));
}

TEST_F(BreathingTableTest, AMeasuredWaveformHasNoOtherCycle) {
  chest_.write("rpm.csv", "time_s,amplitude\n0,1\n1,2\n2,1\n3,0\n4,1\n");
  chest_.write("lung.json",
               test::ChestBench::document(R"("tumour": {"region": 2}, "breathing": {"trace": "rpm.csv"})"));
  const BreathingBench bench = bench_of(chest_.inputs());
  BreathingTable table(bench);
  EXPECT_FALSE(bench.own_motion().cycle_s);
  EXPECT_EQ(table.duration_s(), 4);
  const std::uint64_t before = table.revision();
  EXPECT_THAT(sentence_of([&] { table.apply(true_motion()); }), HasSubstr("has no cycle"));
  EXPECT_EQ(table.revision(), before);
  EXPECT_THAT(sentence_of([&] { static_cast<void>(bench.save("other", true_motion())); }),
              HasSubstr("has no cycle"));
  EXPECT_FALSE(std::filesystem::exists(chest_.folder() / "other.json"));
  // Its own is kept.
  MotionDeed deed = true_motion();
  deed.cycle_s.reset();
  EXPECT_EQ(bench.save("other", deed), "other.json");
  EXPECT_EQ(sim::read_breathing_model(chest_.folder() / "other.json").waveform.duration_s(), 4);
}

/// The groups of the surface, with the rib cage's nodes that `of` takes given to another group.
template <typename Which>
sim::BoundaryGroups painted(const BreathingBench& bench, const Which& of, sim::BoundaryGroup group) {
  sim::BoundaryGroups groups;
  for (const std::uint32_t node : bench.surface().nodes) {
    const sim::BoundaryGroup own = bench.model().groups[node];
    groups.push_back(of(bench.model().mesh.nodes[node], own) ? group : own);
  }
  return groups;
}

TEST_F(BreathingTableTest, PaintedGroupsMoveTheLungAsAModelThatSaysThem) {
  const BreathingBench bench = bench_of(chest_.inputs_with_radiographs());
  BreathingTable table(bench);
  MotionDeed deed = true_motion();
  table.apply(deed);
  const sim::TumourPath before = table.path();
  while (table.measure_one()) {
  }
  double lowest = 1;
  for (const sim::Vector3& node : bench.model().mesh.nodes) lowest = std::min(lowest, node.z());
  deed.surface_groups = painted(
      bench,
      [&](const sim::Vector3& at, sim::BoundaryGroup own) {
        return own == sim::BoundaryGroup::kRibCage && at.z() < lowest + 0.08;
      },
      sim::BoundaryGroup::kDiaphragm);
  const std::uint64_t revision = table.revision();
  table.apply(deed);
  EXPECT_GT(table.revision(), revision);
  EXPECT_THAT(table.similarities(), Each(std::optional<double>())) << "of another lung nothing is known";
  EXPECT_EQ(bench.save("painted", deed), "painted.json");
  const sim::BreathingModel saved = sim::read_breathing_model(chest_.folder() / "painted.json");
  EXPECT_NE(saved.groups, bench.model().groups);
  EXPECT_EQ(saved.groups, bench.model_with(deed).groups) << "what is fitted is what is seen and saved";
  const sim::BreathingBody body(saved.mesh, saved.materials, saved.groups, saved.slide);
  const sim::BreathingCycle cycle(body, saved.motion, saved.waveform);
  const sim::MeshPoint centre = sim::centre_of(saved.mesh, *saved.tumour);
  const sim::TumourPath path = table.path();
  double farthest = 0;
  for (std::size_t i = 0; i < path.times_s.size(); ++i) {
    const sim::Vector3 expected_m = path.rest_m + centre.mean(cycle.displacement_m(path.times_s[i]));
    EXPECT_LT((path.centres_m[i] - expected_m).norm(), 1e-9);
    farthest = std::max(farthest, (path.centres_m[i] - before.centres_m[i]).norm());
  }
  EXPECT_GT(farthest, 0.0005) << "the lung answers otherwise";
  // The picture, too: the DRR alone by the whole solve.
  table.apply(MomentDeed{bench.radiographs()[3].time_s});
  table.apply(LookDeed{sim::OverlayMode::kOpacity, 1, false});
  const sim::ColourPicture shown = table.picture(1).picture;
  BenchInputs again = chest_.inputs_with_radiographs();
  again.model = saved;
  const BreathingBench other = bench_of(std::move(again));
  BreathingTable as_saved(other);
  as_saved.apply(MomentDeed{bench.radiographs()[3].time_s});
  as_saved.apply(LookDeed{sim::OverlayMode::kOpacity, 1, false});
  // But for what the document's numbers round.
  const sim::ColourPicture same = as_saved.picture(1).picture;
  int most = 0;
  for (std::size_t at = 0; at < shown.pixels.size(); ++at)
    most = std::max(most, std::abs(int{shown.pixels[at][0]} - int{same.pixels[at][0]}));
  EXPECT_LE(most, 1);
  // Taken back it is the lung that was opened.
  deed.surface_groups.reset();
  table.apply(deed);
  for (std::size_t i = 0; i < path.times_s.size(); ++i)
    EXPECT_EQ(table.path().centres_m[i], before.centres_m[i]);
}

TEST_F(BreathingTableTest, RefusesGroupsByWhichNothingMovesAndKeepsThoseBefore) {
  const BreathingBench bench = bench_of(chest_.inputs());
  BreathingTable table(bench);
  MotionDeed deed = true_motion();
  table.apply(deed);
  const std::uint64_t revision = table.revision();
  const sim::TumourPath before = table.path();
  const auto refused = [&](sim::BoundaryGroups groups) {
    deed.surface_groups = std::move(groups);
    const std::string sentence = sentence_of([&] { table.apply(deed); });
    EXPECT_EQ(sentence_of([&] { static_cast<void>(bench.save("none", deed)); }), sentence);
    EXPECT_FALSE(std::filesystem::exists(chest_.folder() / "none.json"));
    EXPECT_EQ(table.revision(), revision);
    EXPECT_FALSE(table.motion().surface_groups);
    EXPECT_EQ(table.path().centres_m, before.centres_m);
    return sentence;
  };
  EXPECT_THAT(refused(painted(
                  bench, [](const auto& /*at*/, auto own) { return own == sim::BoundaryGroup::kDiaphragm; },
                  sim::BoundaryGroup::kFree)),
              HasSubstr("no node of the lung is of the group diaphragm"));
  EXPECT_THAT(refused(sim::BoundaryGroups(3, sim::BoundaryGroup::kRibCage)),
              HasSubstr("the groups are of a surface of 3 nodes"));
}

TEST_F(BreathingTableTest, RefusesInWordsWhatCannotBeShown) {
  const auto refused = [&](const auto& change) {
    return sentence_of([&] {
      BenchInputs inputs = chest_.inputs_with_radiographs();
      change(inputs);
      static_cast<void>(bench_of(std::move(inputs)));
    });
  };
  EXPECT_THAT(refused([](BenchInputs& inputs) { inputs.model.tumour.reset(); }),
              HasSubstr("has no tumour: give"));
  for (const auto& [group, name] : {std::pair{sim::BoundaryGroup::kDiaphragm, "diaphragm"},
                                    std::pair{sim::BoundaryGroup::kRibCage, "rib_cage"}}) {
    EXPECT_THAT(refused([&, gone = group](BenchInputs& inputs) {
                  std::ranges::replace(inputs.model.groups, gone, sim::BoundaryGroup::kFree);
                }),
                HasSubstr(std::string("no node of the lung is of the group ") + name));
  }
  EXPECT_THAT(refused([](BenchInputs& inputs) {
                inputs.radiographs[1].image = {64, 32, std::vector<float>(64 * 32)};
              }),
              HasSubstr("picture 1 has 64 x 32 pixels, the geometry says 128 x 128"));
  EXPECT_THAT(refused([](BenchInputs& inputs) { inputs.radiographs[2].time_s = 0.1; }),
              HasSubstr("picture 2 was taken at 0.1 s, not after the one before"));
}

TEST_F(BreathingTableTest, OfManyDeedsTheNewestIsShownAndThenEverythingIsMeasured) {
  const BreathingBench bench = bench_of(chest_.inputs_with_radiographs());
  std::atomic<bool> ready = false;
  std::atomic<std::uint64_t> newest = 0, pictures = 0;
  std::atomic<int> measured = 0;
  std::vector<double> paths_m;
  BreathingListener listener;
  listener.ready = [&] { return ready.load(); };
  listener.shown = [&](const BreathingMoment& moment) {
    newest = moment.input;
    pictures = moment.number;
  };
  listener.moved = [&](const BreathingTable& table) {
    paths_m.push_back(table.motion().motion.diaphragm.amplitude_m);
  };
  listener.measured = [&](const BreathingTable& table) {
    measured = static_cast<int>(
        std::ranges::count_if(table.similarities(), [](const auto& one) { return one.has_value(); }));
  };
  std::atomic<int> told = 0;
  listener.told = [&](const std::string& sentence) {
    EXPECT_THAT(sentence, HasSubstr("no room"));
    ++told;
  };
  listener.refused = [](const std::string& sentence, std::uint64_t /*input*/,
                        const BreathingTable& /*table*/) { ADD_FAILURE() << sentence; };
  listener.failed = [](const std::string& sentence) { ADD_FAILURE() << sentence; };
  {
    LiveBreathing live(bench, listener);
    for (std::uint64_t number = 1; number <= 50; ++number) {
      MotionDeed deed = true_motion();
      deed.motion.diaphragm.amplitude_m = 1e-4 * static_cast<double>(number);
      live.apply(number, deed);
    }
    EXPECT_TRUE(live.run_task([] { throw Error("there is no room"); }));
    ready = true;
    EXPECT_TRUE(test::eventually([&] { return newest == 50 && told == 1; }));
    EXPECT_TRUE(test::eventually([&] { return measured == 6; }));
    EXPECT_LE(pictures, 2U) << "what waited was not shown one by one; the last in all its pixels";
  }
  ASSERT_FALSE(paths_m.empty());
  EXPECT_EQ(paths_m.back(), 0.005);
}

}  // namespace
}  // namespace kiroku::viewer

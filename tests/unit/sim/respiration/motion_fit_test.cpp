// Motions that are known are found again from the radiographs they make.
#include "sim/respiration/motion_fit.h"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/unit/sim/respiration/box_lung.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

ProjectionGeometry view(double gantry_deg) {
  GantrySetup setup;
  setup.isocenter_m = test::kBoxTumourM;
  setup.gantry_deg = gantry_deg;
  setup.pixels = {1024, 768};
  setup.size_m = {0.4, 0.3};
  return ProjectionGeometry(setup);
}

std::vector<Vector3> path_of(const BreathingModel& model, const std::vector<double>& times_s) {
  const BreathingBody body(model.mesh, model.materials, model.groups, model.slide);
  const BreathingCycle cycle(body, model.motion, model.waveform);
  const MeshPoint centre = centre_of(model.mesh, model.needed_tumour());
  std::vector<Vector3> path;
  for (const double time_s : times_s)
    path.push_back(centre.mean(model.mesh.nodes) + centre.mean(cycle.displacement_m(time_s)));
  return path;
}

std::vector<double> frames() {
  std::vector<double> times_s;
  for (int i = 0; i < 54; ++i) times_s.push_back(0.2 * i);
  return times_s;
}

/// `noise_px`: half the range of what the observer is off by.
std::vector<RadiographPosition> radiographs(const BreathingModel& truth,
                                            const std::vector<ProjectionGeometry>& views, double noise_px) {
  std::mt19937 random(11);
  const auto noise = [&] { return noise_px * (2 * double(random()) / 4294967296.0 - 1); };
  const std::vector<double> times_s = frames();
  const std::vector<Vector3> path = path_of(truth, times_s);
  std::vector<RadiographPosition> positions;
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (std::size_t i = 0; i < path.size(); ++i) {
      const auto seen = views[v].project(path[i]);
      const double column = seen->column + noise(), row = seen->row + noise();
      positions.push_back({times_s[i], v, column, row});
    }
  }
  return positions;
}

double farthest_m(const std::vector<Vector3>& a, const std::vector<Vector3>& b) {
  double farthest_m = 0;
  for (std::size_t i = 0; i < a.size(); ++i) farthest_m = std::max(farthest_m, (a[i] - b[i]).norm());
  return farthest_m;
}

BreathingModel moved_by(const BreathingMotion& motion) {
  BreathingModel model = test::box_lung_model();
  model.motion = motion;
  return model;
}

void expect_found(const GroupMotion& found, const GroupMotion& truth, double part, double cycle_s) {
  EXPECT_NEAR(found.amplitude_m, truth.amplitude_m, part * truth.amplitude_m);
  EXPECT_NEAR(found.phase_s, truth.phase_s, part * cycle_s);
}

TEST(MotionFit, AmplitudesAndPhasesAreFoundFromOneView) {
  const BreathingModel truth = moved_by({{0.005, 0.4, std::nullopt}, {0.014, 0.9, std::nullopt}});
  const std::vector<ProjectionGeometry> views{view(0)};
  const BreathingModel model = test::box_lung_model();
  const MotionFitResult found = fit_motion(model, views, radiographs(truth, views, 0), {});
  expect_found(found.motion.rib_cage, truth.motion.rib_cage, 0.01, 3.6);
  expect_found(found.motion.diaphragm, truth.motion.diaphragm, 0.01, 3.6);
  EXPECT_LT(found.residual_m.greatest, 1e-6);
  const double error_m = farthest_m(path_of(moved_by(found.motion), frames()), path_of(truth, frames()));
  EXPECT_LT(error_m, 0.0002);
  RecordProperty("path_mm", std::to_string(1000 * error_m));
  EXPECT_GT(found.before_m, 0.001);
}

TEST(MotionFit, AnObserverWhoIsOffByAPixelStillGivesThePath) {
  const BreathingModel truth = moved_by({{0.005, 0.4, std::nullopt}, {0.014, 0.9, std::nullopt}});
  const std::vector<ProjectionGeometry> views{view(0), view(90)};
  const BreathingModel model = test::box_lung_model();
  const MotionFitResult found = fit_motion(model, views, radiographs(truth, views, 1), {});
  const double error_m = farthest_m(path_of(moved_by(found.motion), frames()), path_of(truth, frames()));
  EXPECT_LT(error_m, 0.0002);
  RecordProperty("path_mm", std::to_string(1000 * error_m));
  // The spread that is told is the observer's: even noise of one pixel, 0.26 mm at the tumour, in both
  // directions.
  EXPECT_NEAR(found.residual_m.mean, 0.77 * 0.00026, 0.00005);
  // And the errors that are told are about those that are made.
  EXPECT_LT(std::abs(found.motion.diaphragm.amplitude_m - truth.motion.diaphragm.amplitude_m),
            4 * found.diaphragm_m);
  EXPECT_LT(std::abs(found.motion.rib_cage.amplitude_m - truth.motion.rib_cage.amplitude_m),
            4 * found.rib_cage_m);
}

TEST(MotionFit, TheDiaphragmsDirectionIsFoundFromTwoViews) {
  const Vector3 direction = Vector3(0.1, -0.25, -1).normalized();
  const BreathingModel truth = moved_by({{0.005, 0.4, std::nullopt}, {0.014, 0.9, direction}});
  const std::vector<ProjectionGeometry> views{view(0), view(90)};
  const BreathingModel model = moved_by({truth.motion.rib_cage, GroupMotion{}});
  const MotionFitResult found = fit_motion(model, views, radiographs(truth, views, 0), {true});
  expect_found(found.motion.diaphragm, truth.motion.diaphragm, 0.01, 3.6);
  ASSERT_TRUE(found.motion.diaphragm.direction);
  EXPECT_LT((*found.motion.diaphragm.direction - direction).norm(), 0.01);
}

TEST(MotionFit, BreathsThatDifferAreFitted) {
  BreathingModel truth = moved_by({{0.005, 0.1, std::nullopt}, {0.014, 0.5, std::nullopt}});
  truth.waveform = Waveform(std::vector<Breath>{{3.4, 1, 0}, {3.9, 1.3, 0.1}, {3.2, 0.8, 0.2}});
  BreathingModel model = test::box_lung_model();
  model.waveform = truth.waveform;
  const std::vector<ProjectionGeometry> views{view(30)};
  const MotionFitResult found = fit_motion(model, views, radiographs(truth, views, 0), {});
  expect_found(found.motion.rib_cage, truth.motion.rib_cage, 0.01, 3.6);
  expect_found(found.motion.diaphragm, truth.motion.diaphragm, 0.01, 3.6);
}

std::string refusal(const std::function<void()>& what) {
  try {
    what();
  } catch (const Error& error) {
    return error.what();
  }
  return "taken";
}

TEST(MotionFit, SaysWhatThePositionsDoNotDetermine) {
  BreathingModel model = test::box_lung_model();
  const std::vector<ProjectionGeometry> views{view(0)};
  EXPECT_THAT(
      refusal([&] { static_cast<void>(fit_motion(model, views, radiographs(model, views, 0), {true})); }),
      HasSubstr("direction cannot be found from one view"));
  // At one moment of each cycle.
  std::vector<RadiographPosition> still = radiographs(model, views, 0);
  for (RadiographPosition& position : still) position = still.front();
  EXPECT_THAT(refusal([&] { static_cast<void>(fit_motion(model, views, still, {})); }),
              HasSubstr("these positions do not determine"));
  model.tumour.reset();
  EXPECT_THAT(refusal([&] { static_cast<void>(fit_motion(model, views, still, {})); }),
              HasSubstr("the model has no tumour: give"));
}

TEST(MotionFit, PositionsAreToldByTheirLine) {
  const auto parse = [](const std::string& text, std::size_t views) {
    return refusal([&] { static_cast<void>(parse_positions(text, "seen.csv", views)); });
  };
  const std::string line = "0.1,1,100,200\n";
  std::string eight = "time_s,view,column,row\n";
  for (int i = 0; i < 8; ++i) eight += line;
  EXPECT_EQ(parse_positions(eight, "seen.csv", 1).size(), 8U);
  EXPECT_THAT(parse("time_s,view,column,row\n0,3,1,1\n", 2),
              HasSubstr("line 2: it is of view 3, and geometries"));
  EXPECT_THAT(parse("time_s,view,column,row\n" + line, 1), HasSubstr("it has 1 positions; 8 at least"));
  EXPECT_THAT(parse("time_s,column,row\n0,1,1\n", 2), HasSubstr("no column 'view', which says"));
  EXPECT_THAT(parse("time_s,view,row\n0,1,1\n", 1), HasSubstr("it has no column 'column'"));
}

}  // namespace
}  // namespace kiroku::sim

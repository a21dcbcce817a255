// A tumour is seen where it shows, predicted where it does not, and lost where a picture is none of the lung.
#include "sim/respiration/tumour_track.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sim/drr/registration.h"
#include "tests/unit/sim/respiration/box_chest.h"

namespace kiroku::sim {
namespace {

TEST(TumourTrack, SeenPredictedAndLostAreToldApart) {
  const Volume volume = test::box_chest();
  const BreathingModel model = test::box_lung_model();
  BreathingScene scene(model, volume);
  test::ChestTruth truth;
  truth.pose = rigid_motion({0.004, -0.003, 0.005}, Vector3(0.02, -0.03, 0.02), scene.middle_m());
  truth.motion.rib_cage = {0.003, 0.3, std::nullopt, 0, 0};
  truth.motion.diaphragm = {0.009, 0.8, std::nullopt, 0, 0};
  truth.noise = 0.02;
  const std::vector<ProjectionGeometry> views{test::chest_view(0), test::chest_view(90)};
  std::vector<SeriesPicture> pictures = test::chest_radiographs(scene, views, truth);
  const MeshPoint centre = centre_of(model.mesh, model.needed_tumour());
  std::vector<Vector3> places_m;
  for (std::size_t i = 0; i < truth.moments; ++i) {
    const double time_s = pictures[i].time_s;
    const Vector3 moved_m = truth.motion.rib_cage.moved_m(truth.waveform, time_s) *
                                scene.response(BoundaryGroup::kRibCage, centre) +
                            truth.motion.diaphragm.moved_m(truth.waveform, time_s) *
                                scene.response(BoundaryGroup::kDiaphragm, centre);
    places_m.emplace_back(truth.pose * (centre.mean(model.mesh.nodes) + moved_m));
  }
  // In moment 5 something covers the tumour in both views; moment 9 was not exposed.
  constexpr std::size_t kCovered = 5, kDark = 9;
  for (std::size_t view = 0; view < 2; ++view) {
    const auto at = views[view].project(places_m[kCovered]);
    ProjectionImage& covered = pictures[view * truth.moments + kCovered].image;
    for (std::size_t row = 0; row < 128; ++row) {
      for (std::size_t column = 0; column < 128; ++column) {
        if (std::hypot(double(column) - at->column, double(row) - at->row) < 12)
          covered.values[row * 128 + column] = 6;
      }
    }
    ProjectionImage& dark = pictures[view * truth.moments + kDark].image;
    for (std::size_t i = 0; i < dark.values.size(); ++i)
      dark.values[i] = static_cast<float>(0.3 * std::sin(0.7 * double(i * i % 1000)));
  }
  const SeriesFit fit = fit_series(model, scene, views, pictures);
  ASSERT_EQ(fit.refusal, "");
  const TumourTrack track = track_tumour(model, scene, volume, views, pictures, fit);
  ASSERT_EQ(track.moments.size(), truth.moments);
  EXPECT_EQ(track.seen + track.predicted + track.lost, truth.moments);
  EXPECT_GE(track.seen, truth.moments - 4);
  EXPECT_EQ(track.moments[kCovered].sight, TumourSight::kPredicted);
  EXPECT_EQ(track.moments[kDark].sight, TumourSight::kLost);
  EXPECT_EQ(track.lost, 1U);
  double sum_m = 0;
  for (std::size_t i = 0; i < truth.moments; ++i) {
    const TumourMoment& moment = track.moments[i];
    if (moment.sight == TumourSight::kLost) continue;
    const double error_m = (moment.place_m - places_m[i]).norm();
    sum_m += error_m;
    EXPECT_LT(error_m, i == kCovered ? 0.003 : 0.0015) << i;
  }
  EXPECT_LT(sum_m / double(truth.moments - 1), 0.0008);
  // Who was covered is less certain.
  EXPECT_GT(track.moments[kCovered].covariance.trace(), track.moments[kCovered + 1].covariance.trace());
  const std::string table = track_csv(track);
  EXPECT_THAT(table, testing::HasSubstr(",,,,,,lost,0\r\n"));
  EXPECT_THAT(table, testing::StartsWith("time_s,x_mm,y_mm,z_mm,error_x_mm"));
}

}  // namespace
}  // namespace kiroku::sim

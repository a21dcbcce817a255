#include "base/error.h"
#include "tests/unit/viewer/compare/textured_plane.h"
#include "viewer/compare/camera_track.h"
#include "viewer/compare/point_hold.h"
#include "viewer/compare/tool_path.h"

namespace kiroku::compare {
namespace {

using test::kSheetHeight;
using test::kSheetWidth;

media::PictureView view(const std::vector<std::uint8_t>& rgb) { return {kSheetWidth, kSheetHeight, 3, rgb}; }

/// A camera that goes along an arc and comes nearer; `share` from 0 to 1.
sim::Camera camera_on_its_way(double share) {
  const sim::Vector3 eye(0.02 + 0.015 * share, -0.05 + 0.006 * share, 0.03 - 0.01 * share);
  return test::camera_from(eye, {0.002 * share, 0, 0});
}

Eigen::Vector2d on_sheet(const sim::Camera& camera, double x_m, double z_m) {
  return *pixel_of(camera, {x_m, 0, z_m}, kSheetWidth, kSheetHeight);
}

constexpr int kPictures = 25;

TEST(PointHold, CarriesPointsWithinAPixelOverAnArc) {
  const std::vector<std::pair<double, double>> places{
      {0, 0}, {0.005, 0.004}, {-0.004, 0.006}, {0.003, -0.005}};
  std::vector<Eigen::Vector2d> points;
  for (const auto& [x, z] : places) points.push_back(on_sheet(camera_on_its_way(0), x, z));
  PointHold hold(view(test::picture_of_sheet(camera_on_its_way(0))), points);
  for (int i = 1; i <= kPictures; ++i) {
    const sim::Camera camera = camera_on_its_way(double(i) / kPictures);
    hold.follow(view(test::picture_of_sheet(camera)));
    for (std::size_t p = 0; p < places.size(); ++p) {
      ASSERT_TRUE(hold.points()[p].has_value()) << i;
      EXPECT_LT((*hold.points()[p] - on_sheet(camera, places[p].first, places[p].second)).norm(), 1)
          << "point " << p << " in picture " << i;
    }
  }
}

TEST(PointHold, SaysWhichPointsItLost) {
  const auto first = test::picture_of_sheet(camera_on_its_way(0));
  const std::vector<Eigen::Vector2d> points{{30, 90}, {225, 90}};
  PointHold hold(view(first), points);
  // The right border becomes flat, and then comes back.
  std::vector<std::uint8_t> changed = first;
  for (std::size_t i = 0; i < changed.size(); ++i) {
    if (i / 3 % kSheetWidth > 180) changed[i] = 90;
  }
  hold.follow(view(changed));
  EXPECT_TRUE(hold.points()[0].has_value());
  EXPECT_FALSE(hold.points()[1].has_value());
  hold.follow(view(first));
  EXPECT_FALSE(hold.points()[1].has_value()) << "what is lost stays lost";
  const std::vector<std::uint8_t> small(30);
  EXPECT_THROW(hold.follow({5, 2, 3, small}), Error);
}

TEST(PointHold, LosesWhatLeavesThePicture) {
  const std::vector<Eigen::Vector2d> points{on_sheet(camera_on_its_way(0), -0.008, 0)};
  PointHold hold(view(test::picture_of_sheet(camera_on_its_way(0))), points);
  for (int i = 1; i <= kPictures; ++i) {
    sim::Camera camera = camera_on_its_way(0);
    camera.centre.x() = 0.02 * i;
    hold.follow(view(test::picture_of_sheet(camera)));
  }
  EXPECT_FALSE(hold.points()[0].has_value());
}

PickedRegistration picked_on_sheet(std::int64_t time_ns) {
  PickedRegistration picked;
  picked.time_ns = time_ns;
  picked.field_deg = 40;
  for (const auto& [x, z] :
       {std::pair{-0.008, -0.006}, {0.008, -0.006}, {0.008, 0.006}, {-0.008, 0.006}, {0.001, 0.002}})
    picked.points.push_back({{x, 0, z}, on_sheet(camera_on_its_way(0), x, z)});
  return picked;
}

TEST(CameraTrack, FollowsTheCamera) {
  CameraTrack track(picked_on_sheet(15), kSheetWidth, kSheetHeight);
  EXPECT_LT(track.registration().rms_px, 1e-3);
  // Two pictures before the picked one stands still.
  track.take(0, view(test::picture_of_sheet(camera_on_its_way(0))));
  for (int i = 0; i <= kPictures; ++i)
    track.take(10 + 10 * i, view(test::picture_of_sheet(camera_on_its_way(double(i) / kPictures))));
  track.finish();
  EXPECT_FALSE(track.lost_ns().has_value());
  EXPECT_FALSE(track.held_at(9));
  EXPECT_TRUE(track.held_at(10));
  EXPECT_LT(track.largest_rms_px(), 0.5);
  for (int i = 0; i <= kPictures; ++i) {
    const sim::Camera truth = camera_on_its_way(double(i) / kPictures);
    const sim::Camera& found = track.camera_at(10 + 10 * i);
    for (const auto& [x, z] : {std::pair{0.0, 0.0}, {0.006, 0.004}}) {
      EXPECT_LT((on_sheet(found, x, z) - on_sheet(truth, x, z)).norm(), 0.5) << i;
    }
    EXPECT_LT((found.eye_m - truth.eye_m).norm(), 2e-3) << i;
  }
}

/// A tool's tip over the sheet: as bright as nothing else.
std::vector<std::uint8_t> with_tip(std::vector<std::uint8_t> rgb, const Eigen::Vector2d& at) {
  constexpr double kRadiusPx = 9;
  for (int row = 0; row < kSheetHeight; ++row) {
    for (int column = 0; column < kSheetWidth; ++column) {
      const double off = (Eigen::Vector2d(column, row) - at).norm() / kRadiusPx;
      if (off > 1) continue;
      const auto pixel = static_cast<std::ptrdiff_t>(3 * (row * kSheetWidth + column));
      std::fill_n(rgb.begin() + pixel, 3, static_cast<std::uint8_t>(255 - 120 * off * off));
    }
  }
  return rgb;
}

TEST(CameraTrack, DropsWhatATipTakesAlong) {
  PickedRegistration picked = picked_on_sheet(0);
  for (const auto& [x, z] : {std::pair{0.0, -0.004}, {-0.005, 0.001}})
    picked.points.push_back({{x, 0, z}, on_sheet(camera_on_its_way(0), x, z)});
  CameraTrack track(picked, kSheetWidth, kSheetHeight);
  const auto sheet = test::picture_of_sheet(camera_on_its_way(0));
  const Eigen::Vector2d passed = picked.points.back().pixel;
  bool is_taken = false;
  PointHold alone(view(with_tip(sheet, passed)), std::span(&passed, 1));
  track.take(0, view(with_tip(sheet, passed)));
  for (int i = 1; i <= kPictures; ++i) {
    const auto picture = with_tip(sheet, passed + Eigen::Vector2d(0.8 * i, 0.2 * i));
    track.take(10 * i, view(picture));
    alone.follow(view(picture));
    is_taken |= alone.points()[0] && (*alone.points()[0] - passed).norm() > 8;
    const sim::Camera& found = track.camera_at(10 * i);
    for (const auto& [x, z] : {std::pair{0.0, 0.0}, {0.006, 0.004}})
      EXPECT_LT((on_sheet(found, x, z) - on_sheet(camera_on_its_way(0), x, z)).norm(), 1) << i;
  }
  track.finish();
  EXPECT_TRUE(is_taken) << "the flow alone goes along with the tip";
  EXPECT_FALSE(track.lost_ns().has_value());
}

TEST(CameraTrack, SaysWhenItLostTheOrgan) {
  CameraTrack track(picked_on_sheet(0), kSheetWidth, kSheetHeight);
  const auto sheet = test::picture_of_sheet(camera_on_its_way(0));
  const std::vector<std::uint8_t> smoke(sheet.size(), 200);
  track.take(0, view(sheet));
  track.take(10, view(sheet));
  track.take(20, view(smoke));
  track.take(30, view(sheet));
  track.finish();
  EXPECT_EQ(track.lost_ns(), 20);
  EXPECT_TRUE(track.held_at(10));
  EXPECT_FALSE(track.held_at(20));
  EXPECT_LT((track.camera_at(30).eye_m - camera_on_its_way(0).eye_m).norm(), 1e-3);
}

TEST(ToolPath, GoesThroughTheClicksAndFollowsInBetween) {
  const auto at = [](int i) { return on_sheet(camera_on_its_way(double(i) / kPictures), 0.003, 0.002); };
  // Clicked at the first, a middle and the last picture; each time between two pictures.
  ToolPathRecorder recorder({{25 * 10 + 3, at(25)}, {4, at(0)}, {12 * 10 + 9, at(12)}});
  for (int i = 0; i <= kPictures; ++i)
    recorder.take(10 * i, view(test::picture_of_sheet(camera_on_its_way(double(i) / kPictures))));
  const RecordedPath path = recorder.finish();
  ASSERT_EQ(path.points.size(), std::size_t{kPictures + 1});
  EXPECT_TRUE(path.lost.empty());
  EXPECT_LT(path.largest_drift_px, 1);
  for (int i = 0; i <= kPictures; ++i) {
    EXPECT_EQ(path.points[static_cast<std::size_t>(i)].time_ns, 10 * i);
    EXPECT_LT((path.points[static_cast<std::size_t>(i)].pixel - at(i)).norm(), 0.5) << i;
  }
  EXPECT_EQ(path.points[12].pixel, at(12));
}

TEST(ToolPath, TakesDriftBackEvenly) {
  const auto sheet = test::picture_of_sheet(camera_on_its_way(0));
  // Nothing moves, and the second click says that the tip is 4 pixels farther.
  ToolPathRecorder recorder({{0, {100, 80}}, {40, {104, 80}}});
  for (int i = 0; i <= 4; ++i) recorder.take(10 * i, view(sheet));
  const RecordedPath path = recorder.finish();
  EXPECT_NEAR(path.largest_drift_px, 4, 0.1);
  ASSERT_EQ(path.points.size(), 5U);
  EXPECT_NEAR(path.points[2].pixel.x(), 102, 0.1);
}

TEST(ToolPath, StatesWhereTheTipWasLost) {
  const auto sheet = test::picture_of_sheet(camera_on_its_way(0));
  const std::vector<std::uint8_t> smoke(sheet.size(), 200);
  ToolPathRecorder recorder({{0, {100, 80}}, {50, {100, 80}}});
  for (int i = 0; i <= 9; ++i) recorder.take(10 * i, view(i == 2 || i == 8 ? smoke : sheet));
  const RecordedPath path = recorder.finish();
  ASSERT_EQ(path.lost.size(), 2U);
  EXPECT_EQ(path.lost[0].start_ns, 20);
  EXPECT_EQ(path.lost[0].end_ns, 50);
  EXPECT_EQ(path.lost[1].start_ns, 80);
  EXPECT_EQ(path.lost[1].end_ns, 90);
  EXPECT_EQ(path.points.size(), 2U + 3U);
}

}  // namespace
}  // namespace kiroku::compare

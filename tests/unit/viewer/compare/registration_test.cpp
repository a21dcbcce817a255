#include "viewer/compare/registration.h"

#include <numbers>
#include <random>

#include "base/error.h"

namespace kiroku::compare {
namespace {

using testing::HasSubstr;

constexpr int kRegistrationWidth = 640, kRegistrationHeight = 480;

double uniform(std::mt19937& random, double least, double most) {
  return least + (most - least) * double(random()) / 4294967296.0;
}

sim::Camera camera_from_the_left(double field_deg) {
  sim::Camera camera =
      sim::camera_looking_at({{0.01, -0.02, 0.03}, 0.08}, {70, 25}, kRegistrationWidth, kRegistrationHeight);
  const double half = std::tan(field_deg * std::numbers::pi / 360);
  camera.half_extent = {half * kRegistrationWidth / kRegistrationHeight, half};
  return camera;
}

std::vector<PickedPoint> seen_points(const sim::Camera& camera, std::size_t count, double noise_px) {
  std::mt19937 random(11);
  std::vector<PickedPoint> points;
  while (points.size() < count) {
    const sim::Vector3 at(uniform(random, -0.04, 0.06), uniform(random, -0.07, 0.03),
                          uniform(random, -0.02, 0.08));
    const auto pixel = pixel_of(camera, at, kRegistrationWidth, kRegistrationHeight);
    if (!pixel || pixel->x() < 5 || pixel->y() < 5 || pixel->x() > kRegistrationWidth - 6 ||
        pixel->y() > kRegistrationHeight - 6)
      continue;
    points.push_back({at, *pixel + Eigen::Vector2d(uniform(random, -noise_px, noise_px),
                                                   uniform(random, -noise_px, noise_px))});
  }
  return points;
}

TEST(Registration, SeesThePointsWhereTheyWerePicked) {
  const sim::Camera truth = camera_from_the_left(35);
  for (const std::size_t count : {4U, 5U, 8U, 20U}) {
    const Registration found =
        register_camera(seen_points(truth, count, 0), kRegistrationWidth, kRegistrationHeight, 35);
    EXPECT_LT(found.rms_px, 1e-3) << count;
    EXPECT_LT((found.camera.eye_m - truth.eye_m).norm(), 1e-5) << count;
    EXPECT_LT((found.camera.to_view - truth.to_view).norm(), 1e-4) << count;
    EXPECT_NEAR(found.camera.half_extent.x(), truth.half_extent.x(), 1e-12);
    EXPECT_EQ(found.error_px.size(), count);
  }
}

TEST(Registration, TellsHowFarClicksAreOff) {
  const Registration found = register_camera(seen_points(camera_from_the_left(35), 12, 3), kRegistrationWidth,
                                             kRegistrationHeight, 35);
  EXPECT_GT(found.rms_px, 0.5);
  EXPECT_LT(found.rms_px, 3);
  double sum = 0;
  for (const double error : found.error_px) sum += error * error;
  EXPECT_NEAR(found.rms_px, std::sqrt(sum / 12), 1e-12);
}

TEST(Registration, EstimatesTheFieldOfView) {
  for (const double field_deg : {25.0, 60.0, 90.0}) {
    const Registration found = register_camera(seen_points(camera_from_the_left(field_deg), 10, 0),
                                               kRegistrationWidth, kRegistrationHeight, {});
    EXPECT_TRUE(found.field_estimated);
    EXPECT_NEAR(found.field_deg, field_deg, 0.05);
    EXPECT_LT(found.rms_px, 0.05);
  }
}

std::string refusal(const std::vector<PickedPoint>& points, std::optional<double> field_deg = 35) {
  try {
    register_camera(points, kRegistrationWidth, kRegistrationHeight, field_deg);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

TEST(Registration, RefusesPointsFromWhichNoCameraComes) {
  const sim::Camera truth = camera_from_the_left(35);
  std::vector<PickedPoint> points = seen_points(truth, 6, 0);
  EXPECT_THAT(refusal({points.begin(), points.begin() + 3}), HasSubstr("from 3 points: pick at least 4"));
  std::vector<PickedPoint> line;
  for (int i = 0; i < 6; ++i) {
    const sim::Vector3 at = points[0].organ_m + (points[1].organ_m - points[0].organ_m) * i / 5;
    line.push_back({at, *pixel_of(truth, at, kRegistrationWidth, kRegistrationHeight)});
  }
  EXPECT_THAT(refusal(line), HasSubstr("lie on one line or in one spot"));
  EXPECT_THAT(refusal({4, points[0]}), HasSubstr("lie on one line or in one spot"));
  EXPECT_THAT(refusal({points.begin(), points.begin() + 5}, {}), HasSubstr("cannot be estimated"));
  points[2].pixel.x() = kRegistrationWidth;
  EXPECT_THAT(refusal(points), HasSubstr("point 3 lies outside the picture"));
  EXPECT_THAT(refusal(seen_points(truth, 6, 0), 200), HasSubstr("from 10 to 120"));
}

TEST(Registration, TakesAPlaneOnlyWhereItIsSeenInOneWay) {
  const sim::Camera near = [] {
    sim::Camera camera =
        sim::camera_looking_at({{0, 0, 0}, 0.03}, {40, 30}, kRegistrationWidth, kRegistrationHeight);
    const double half = std::tan(35 * std::numbers::pi / 180);
    camera.eye_m *= 0.5;
    camera.half_extent = {half * kRegistrationWidth / kRegistrationHeight, half};
    return camera;
  }();
  const auto square = [&](double side_m) {
    std::vector<PickedPoint> points;
    for (const auto& [x, z] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}, {0.0, 0.2}}) {
      const sim::Vector3 at(side_m * x, 0, side_m * z);
      points.push_back({at, *pixel_of(near, at, kRegistrationWidth, kRegistrationHeight)});
    }
    return points;
  };
  const Registration found = register_camera(square(0.04), kRegistrationWidth, kRegistrationHeight, 70);
  EXPECT_LT((found.camera.eye_m - near.eye_m).norm(), 1e-4);
  // Of so small a part nothing tells which side is nearer.
  EXPECT_THAT(refusal(square(0.002), 70), HasSubstr("two cameras see alike"));
}

TEST(Registration, PointsBehindTheCameraAreNotSeen) {
  const sim::Camera camera = camera_from_the_left(35);
  const sim::Vector3 backward = camera.to_view.row(2);
  EXPECT_FALSE(
      pixel_of(camera, camera.eye_m + backward, kRegistrationWidth, kRegistrationHeight).has_value());
  const auto middle = pixel_of(camera, camera.eye_m - backward, kRegistrationWidth, kRegistrationHeight);
  EXPECT_NEAR(middle->x(), (kRegistrationWidth - 1) / 2.0, 1e-9);
  EXPECT_NEAR(middle->y(), (kRegistrationHeight - 1) / 2.0, 1e-9);
}

}  // namespace
}  // namespace kiroku::compare

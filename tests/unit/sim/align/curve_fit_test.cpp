// An organ laid on curves that were drawn in a picture, with its place known.
#include "sim/align/curve_fit.h"

#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/endoscope_scene.h"

namespace kiroku::sim {
namespace {

constexpr int kDrawnWidth = 640, kDrawnHeight = 480;
/// Its axis is beside the middle, as a real endoscope's is.
const Pinhole kBesideAxis{420, 290, 250};

const OrganSurface& drawn_organ() {
  static const OrganSurface surface = organ_surface(test::liver_like_mesh({24, 8, 18}));
  return surface;
}

Camera drawn_from() {
  static const test::EndoscopeScene scene(test::liver_like_mesh({2, 2, 2}));
  return scene.camera(8, -18, 0.14, 12);
}

/// On the organ's front, along a way across it.
std::vector<Vector3> front_line(const Vector3& from, const Vector3& bend, const Vector3& to) {
  std::vector<Vector3> line;
  constexpr int kPlaces = 16;
  for (int i = 0; i <= kPlaces; ++i) {
    const double s = double(i) / kPlaces;
    const Vector3 at = (1 - s) * (1 - s) * from + 2 * s * (1 - s) * bend + s * s * to;
    const auto nearest = std::ranges::min_element(
        drawn_organ().nodes, {}, [&](const Vector3& node) { return (node - at).squaredNorm(); });
    if (line.empty() || (line.back() - *nearest).norm() > 0) line.push_back(*nearest);
  }
  return line;
}

/// To whole pixels, as a person draws.
DrawnCurve drawn(std::vector<Vector3> line_m) {
  DrawnCurve curve;
  for (const Vector3& place : line_m)
    curve.pixels.emplace_back(kBesideAxis.pixel(drawn_from().view_m(place)).array().round());
  curve.line_m = std::move(line_m);
  return curve;
}

DrawnCurve ridge() {
  return drawn(front_line({-0.06, -0.03, -0.04}, {-0.02, -0.05, 0}, {0.03, -0.02, -0.02}));
}
DrawnCurve ligament() {
  return drawn(front_line({0.0, -0.03, 0.04}, {0.02, -0.04, 0.01}, {0.02, -0.03, -0.02}));
}

/// What of the outline lies left of the organ's middle, from below upwards, as a person draws: places apart
/// from each other. It goes on beyond the picture's border.
DrawnCurve left_outline() {
  const auto outline =
      outline_around(drawn_organ(), drawn_from(), kBesideAxis, kDrawnWidth, kDrawnHeight, 3, 1);
  const Eigen::Vector2d middle = kBesideAxis.pixel(drawn_from().view_m(drawn_organ().middle_m));
  std::vector<Eigen::Vector2d> left;
  for (const OutlinePoint& point : *outline) {
    const Eigen::Vector2d off = point.pixel - middle;
    if (off.x() < -std::abs(off.y())) left.push_back(point.pixel);
  }
  std::ranges::sort(left, std::greater{}, [&](const Eigen::Vector2d& at) {
    return std::atan2(at.y() - middle.y(), middle.x() - at.x());
  });
  DrawnCurve curve;
  constexpr double kApartPx = 15;
  for (const Eigen::Vector2d& pixel : left) {
    if (curve.pixels.empty() || (curve.pixels.back() - pixel).norm() > kApartPx)
      curve.pixels.push_back(pixel);
  }
  return curve;
}

double camera_off_m(const CurveFit& fit) { return way_between_m(drawn_organ(), fit.camera, drawn_from()); }

Camera begun_off(double m) {
  Motion motion;
  motion << m, -m, 2 * m, m, -m, m;
  return after_motion(drawn_organ(), drawn_from(), motion);
}

TEST(CurveFit, FindsTheOrganFromAnywhereByLinesOnIt) {
  SearchRange anywhere;
  anywhere.spread_deg = 180;
  const auto fits =
      find_curves(drawn_organ(), anywhere, kBesideAxis, kDrawnWidth, kDrawnHeight, {ridge(), ligament()});
  ASSERT_FALSE(fits.empty());
  EXPECT_LT(camera_off_m(fits[0]), 0.003);
  EXPECT_LT(fits[0].misfit_px, 1);
  ASSERT_EQ(fits[0].curve_px.size(), 2U);
  for (std::size_t i = 1; i < fits.size(); ++i) EXPECT_GT(fits[i].misfit_px, 2 * fits[0].misfit_px) << i;
  EXPECT_LT(camera_off_m(fits[0]),
            3 * standard_error_m(drawn_organ(), fits[0].camera, fits[0].covariance_m2));
  // What a page or a film draws with that camera falls on the same pixels.
  const Camera& camera = fits[0].camera;
  const Vector3 view = camera.view_m(drawn_organ().middle_m);
  const Eigen::Vector2d share =
      (view.head<2>() / -view.z() - camera.centre).cwiseQuotient(camera.half_extent);
  const Eigen::Vector2d pixel = kBesideAxis.pixel(view);
  EXPECT_NEAR((share.x() + 1) / 2 * kDrawnWidth - 0.5, pixel.x(), 1e-9);
  EXPECT_NEAR((1 - share.y()) / 2 * kDrawnHeight - 0.5, pixel.y(), 1e-9);
}

TEST(CurveFit, DoesNotAskFromWhichEndALineWasMarked) {
  DrawnCurve backwards = ridge();
  std::ranges::reverse(backwards.line_m);
  const auto fit = fit_curves(drawn_organ(), kBesideAxis, kDrawnWidth, kDrawnHeight, begun_off(0.004),
                              {backwards, ligament()});
  ASSERT_TRUE(fit);
  EXPECT_LT(camera_off_m(*fit), 0.003);
}

TEST(CurveFit, APartOfTheOutlineSaysWhatALineLeavesOpen) {
  ASSERT_GE(left_outline().pixels.size(), 10U);
  // Nearly straight: the organ could turn about it.
  const DrawnCurve straight = drawn(front_line({-0.03, -0.03, 0}, {-0.015, -0.03, 0}, {0, -0.03, 0}));
  const auto line = fit_curves(drawn_organ(), kBesideAxis, kDrawnWidth, kDrawnHeight, begun_off(0.006),
                               {straight}),
             both = fit_curves(drawn_organ(), kBesideAxis, kDrawnWidth, kDrawnHeight, begun_off(0.006),
                               {straight, left_outline()});
  ASSERT_TRUE(line);
  ASSERT_TRUE(both);
  EXPECT_LT(camera_off_m(*both), 0.004);
  EXPECT_LT(camera_off_m(*both), camera_off_m(*line));
  EXPECT_LT(standard_error_m(drawn_organ(), both->camera, both->covariance_m2),
            standard_error_m(drawn_organ(), line->camera, line->covariance_m2));
}

TEST(CurveFit, FindsTheOrganFromAnywhereByALineAndAPartOfTheOutline) {
  SearchRange anywhere;
  anywhere.spread_deg = 180;
  const auto fits =
      find_curves(drawn_organ(), anywhere, kBesideAxis, kDrawnWidth, kDrawnHeight, {ridge(), left_outline()});
  ASSERT_FALSE(fits.empty());
  EXPECT_LT(camera_off_m(fits[0]), 0.004);
}

TEST(CurveFit, AnOutlineOutOfReachCountsAsThatFar) {
  DrawnCurve beside;
  for (int y = 0; y < kDrawnHeight; y += 10) beside.pixels.emplace_back(-4000, y);
  const auto fit =
      fit_curves(drawn_organ(), kBesideAxis, kDrawnWidth, kDrawnHeight, drawn_from(), {ridge(), beside});
  ASSERT_TRUE(fit);
  EXPECT_EQ(fit->curve_px[1], kDrawnHeight / 2);
  EXPECT_LT(fit->curve_px[0], 1);
}

TEST(CurveFit, SaysNothingOfALineBehindTheEye) {
  Camera behind = drawn_from();
  behind.to_view.row(0) *= -1;
  behind.to_view.row(2) *= -1;
  EXPECT_FALSE(fit_curves(drawn_organ(), kBesideAxis, kDrawnWidth, kDrawnHeight, behind, {ridge()}));
  EXPECT_FALSE(fit_curves(drawn_organ(), kBesideAxis, kDrawnWidth, kDrawnHeight, behind, {left_outline()}));
}

TEST(CurveFit, RefusesCurvesWithoutLength) {
  const auto fitted = [](const std::vector<DrawnCurve>& curves) {
    return fit_curves(drawn_organ(), kBesideAxis, kDrawnWidth, kDrawnHeight, drawn_from(), curves);
  };
  EXPECT_THROW(fitted({}), UsageError);
  EXPECT_THROW(fitted({{{{10, 10}}, {}}}), UsageError);
  EXPECT_THROW(fitted({{{{10, 10}, {10, 10}}, {}}}), UsageError);
  EXPECT_THROW(fitted({{{{10, 10}, {20, 10}}, {Vector3::Zero()}}}), UsageError);
  EXPECT_THROW(fitted({{{{10, 10}, {NAN, 10}}, {}}}), UsageError);
  EXPECT_THROW(find_curves(drawn_organ(), {}, kBesideAxis, kDrawnWidth, kDrawnHeight, {left_outline()}),
               UsageError);
}

TEST(OrganSurface, OfFacesIsThatOfTheMesh) {
  const OrganSurface made = organ_surface(drawn_organ().nodes, drawn_organ().faces);
  EXPECT_EQ(made.edges.size(), drawn_organ().edges.size());
  EXPECT_EQ(made.middle_m, drawn_organ().middle_m);
  EXPECT_EQ(made.radius_m, drawn_organ().radius_m);
  EXPECT_EQ(made.mesh_nodes.back(), drawn_organ().nodes.size() - 1);
}

TEST(OrganSurface, RefusesFacesThatCloseNothing) {
  auto faces = drawn_organ().faces;
  faces.pop_back();
  EXPECT_THROW(organ_surface(drawn_organ().nodes, faces), UsageError);
  faces.push_back({0, 1, static_cast<std::uint32_t>(drawn_organ().nodes.size())});
  EXPECT_THROW(organ_surface(drawn_organ().nodes, faces), UsageError);
  EXPECT_THROW(organ_surface(drawn_organ().nodes, {}), UsageError);
}

}  // namespace
}  // namespace kiroku::sim

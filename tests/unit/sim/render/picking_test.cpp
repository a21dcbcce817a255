#include "sim/render/picking.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

TEST(Picking, FindsWhereALineFirstMeetsTheSurface) {
  const TetMesh box = test::tet_grid({4, 4, 4}, {0.1, 0.06, 0.08});
  const Camera camera = camera_looking_at(ball_around(box), {0, 0}, 640, 480);
  std::vector<Vector3> places;
  for (const Vector3& node : box.nodes) places.push_back(in_depth_m(camera, node));
  const std::vector<Face> surface = faces_of(box).surface;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> of_box(0.01, 0.99);
  for (int i = 0; i < 100; ++i) {
    // From the front one sees the side y = 0.
    const Vector3 seen_m(0.1 * of_box(random), 0, 0.08 * of_box(random));
    const Vector3 place_m = in_depth_m(camera, seen_m);
    EXPECT_LT((from_depth_m(camera, place_m) - seen_m).norm(), 1e-12);
    const Eigen::Vector2d slope = place_m.head<2>() / place_m.z();
    const auto depth_m = depth_along(surface, places, slope);
    ASSERT_TRUE(depth_m.has_value());
    EXPECT_NEAR(*depth_m, place_m.z(), 1e-9);
    const auto met = first_met(surface, places, slope);
    ASSERT_TRUE(met.has_value());
    Vector3 there_m = Vector3::Zero();
    for (std::size_t corner = 0; corner < 3; ++corner)
      there_m +=
          met->weights[static_cast<Eigen::Index>(corner)] * box.nodes[surface[met->face].nodes[corner]];
    EXPECT_LT((there_m - seen_m).norm(), 1e-9) << "weights are those of the face in space";
    // The same place of the picture.
    const Eigen::Vector2d at = (slope - camera.centre).cwiseQuotient(camera.half_extent);
    EXPECT_LT((slope_of(camera, (1 + at.x()) / 2, (1 - at.y()) / 2) - slope).norm(), 1e-12);
    const Eigen::Vector2d on = on_picture(camera, seen_m);
    EXPECT_LT((slope_of(camera, on.x(), on.y()) - slope).norm(), 1e-12);
  }
  EXPECT_FALSE(depth_along(surface, places, slope_of(camera, 0.01, 0.01)).has_value());
}

}  // namespace
}  // namespace kiroku::sim

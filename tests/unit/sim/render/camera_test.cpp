#include "sim/render/camera.h"

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

const Vector3 kLeft(1, 0, 0), kBack(0, 1, 0), kHead(0, 0, 1);

TEST(Camera, LooksFromWhereItIsTold) {
  const Ball ball{{0.1, 0.2, 0.3}, 0.05};
  struct Expected {
    const char* from;
    Vector3 to_right, up;  // of the picture
  };
  // Seen from the front, the patient's left is on the right of the picture, as in radiology.
  const std::vector<Expected> all{{"front", kLeft, kHead},  {"back", -kLeft, kHead}, {"left", kBack, kHead},
                                  {"right", -kBack, kHead}, {"head", kLeft, kBack},  {"feet", kLeft, -kBack},
                                  {"0,0", kLeft, kHead}};
  for (const Expected& expected : all) {
    const Camera camera = camera_looking_at(ball, view_direction(expected.from), 200, 100);
    EXPECT_LT((camera.to_view * expected.to_right - Vector3::UnitX()).norm(), 1e-12) << expected.from;
    EXPECT_LT((camera.to_view * expected.up - Vector3::UnitY()).norm(), 1e-12) << expected.from;
    EXPECT_NEAR(camera.to_view.determinant(), 1, 1e-12);
    const Vector3 middle = camera.view_m(ball.centre_m);
    EXPECT_LT(middle.head<2>().norm(), 1e-12);
    EXPECT_LT(middle.z(), -ball.radius_m);
    // The ball just touches the borders of the lesser side.
    EXPECT_NEAR(ball.radius_m / std::sqrt(middle.z() * middle.z() - ball.radius_m * ball.radius_m),
                camera.half_extent.y(), 1e-12);
    EXPECT_NEAR(camera.half_extent.x(), 2 * camera.half_extent.y(), 1e-12);
  }
}

TEST(Camera, RefusesAViewThatIsNone) {
  for (const std::string text : {"above", "10", "10,", "10,x", "400,0", "0,100", "nan,0"}) {
    try {
      view_direction(text);
      FAIL() << text;
    } catch (const UsageError& error) {
      EXPECT_THAT(error.what(), HasSubstr("'" + text + "'"));
      EXPECT_THAT(error.what(), HasSubstr("front, back"));
    }
  }
}

TEST(Camera, LeavesLooseNodesOut) {
  TetMesh mesh = test::tet_grid({1, 1, 1}, {2, 2, 2});
  mesh.nodes.emplace_back(100, 100, 100);
  const Ball ball = ball_around(mesh);
  EXPECT_LT((ball.centre_m - Vector3::Ones()).norm(), 1e-12);
  EXPECT_NEAR(ball.radius_m, std::sqrt(3), 1e-12);
}

}  // namespace
}  // namespace kiroku::sim

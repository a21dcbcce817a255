// Not in the header: nine rays a pixel take seconds in a test program that is compiled without optimisation.
#include "tests/support/chessboard.h"

#include <cmath>

namespace kiroku::test {

std::vector<std::uint8_t> chessboard_picture(
    int width, int height, int columns, int rows, const BoardPose& pose,
    const std::function<std::array<double, 2>(double x, double y)>& plane_of) {
  using Vector = std::array<double, 3>;
  const double cx = std::cos(pose.about_x), sx = std::sin(pose.about_x), cy = std::cos(pose.about_y),
               sy = std::sin(pose.about_y), cz = std::cos(pose.turn), sz = std::sin(pose.turn);
  // Columns of Rz Ry Rx: the board's axes and its normal.
  const Vector right{cz * cy, sz * cy, -sy}, down{cz * sy * sx - sz * cx, sz * sy * sx + cz * cx, cy * sx},
      normal{cz * sy * cx + sz * sx, sz * sy * cx - cz * sx, cy * cx};
  const auto dot = [](const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
  const auto light = [&](double x, double y) -> double {
    constexpr double kWall = 90, kWhite = 225, kBlack = 30;
    const auto plane = plane_of(x, y);
    const Vector ray{plane[0], plane[1], 1};
    const double along = dot(normal, pose.middle) / dot(normal, ray);
    if (!(along > 0)) return kWall;
    const Vector off{along * ray[0] - pose.middle[0], along * ray[1] - pose.middle[1],
                     along * ray[2] - pose.middle[2]};
    const double u = dot(right, off) + (columns + 1) / 2.0, v = dot(down, off) + (rows + 1) / 2.0;
    if (u < -0.7 || v < -0.7 || u > columns + 1.7 || v > rows + 1.7) return kWall;
    if (u < 0 || v < 0 || u >= columns + 1 || v >= rows + 1) return kWhite;
    return (static_cast<int>(u) + static_cast<int>(v)) % 2 == 0 ? kBlack : kWhite;
  };
  std::vector<std::uint8_t> grey;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double sum = 0;
      for (int ray = 0; ray < 9; ++ray) sum += light(x + (ray % 3 - 1) / 3.0, y + (ray / 3 - 1) / 3.0);
      grey.push_back(static_cast<std::uint8_t>(std::lround(sum / 9)));
    }
  }
  return grey;
}

}  // namespace kiroku::test

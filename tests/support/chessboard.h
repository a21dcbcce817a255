// A chessboard before a camera, drawn by rays, so that each place of it is known.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

namespace kiroku::test {

/// How a board lies: turned about the camera's x and y, then about its axis, radians; its middle, in squares.
struct BoardPose {
  double about_x = 0, about_y = 0, turn = 0;
  std::array<double, 3> middle{};
};

/// Ten or so poses: tilted to all sides, also in the picture's corners. For a camera whose picture covers
/// about 60 degrees, a board of 9 x 6 inner corners.
inline std::vector<BoardPose> board_poses() {
  std::vector<BoardPose> poses;
  for (const double x : {-1.0, 1.0}) {
    for (const double y : {-1.0, 1.0})
      poses.push_back({0.35 * y, 0.3 * x, 0.1 * x * y, {6.4 * x, 4.6 * y, 17}});
  }
  poses.push_back({0, 0, 0, {0, 0, 11.5}});
  for (const double x : {-1.0, 1.0}) {
    poses.push_back({0, 0.6 * x, 0.2, {0.5 * x, 0, 14}});
    poses.push_back({0.6 * x, 0, -0.2, {0, 0.5 * x, 14}});
    poses.push_back({0.4 * x, -0.4 * x, 0.3 * x, {3 * x, 0, 16}});
  }
  return poses;
}

/// (height x width) of grey, rows from the top; nine rays a pixel. `plane_of`: what a place of the picture
/// shows at distance 1, x to the right, y down, pixels from the middle of the first one.
[[nodiscard]] std::vector<std::uint8_t> chessboard_picture(
    int width, int height, int columns, int rows, const BoardPose& pose,
    const std::function<std::array<double, 2>(double x, double y)>& plane_of);

}  // namespace kiroku::test

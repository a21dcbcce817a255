#include "sim/align/lens_calibrator.h"

#include <gmock/gmock.h>

#include "base/error.h"
#include "tests/support/barrel_lens.h"
#include "tests/support/chessboard.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;
using Taken = LensCalibrator::Taken;

constexpr int kBoardColumns = 9, kBoardRows = 6, kBoardWidth = 640, kBoardHeight = 480;
constexpr double kStraightDeg = 60;

std::vector<std::uint8_t> picture_of(const test::BoardPose& pose, const test::BarrelLens& lens) {
  const Pinhole straight = pinhole_of(kStraightDeg, kBoardWidth, kBoardHeight);
  return test::chessboard_picture(
      kBoardWidth, kBoardHeight, kBoardColumns, kBoardRows, pose, [&](double x, double y) {
        const Eigen::Vector2d at = lens.straight({x, y});
        return std::array<double, 2>{(at.x() - straight.middle_x) / straight.focal_px,
                                     (at.y() - straight.middle_y) / straight.focal_px};
      });
}

std::string refusal(const LensCalibrator& calibrator) {
  try {
    (void)calibrator.solve();
  } catch (const UsageError& error) {
    return error.what();
  }
  return "taken";
}

TEST(LensCalibrator, FindsABarrelWithinThreePixels) {
  const test::BarrelLens barrel = test::BarrelLens::of_corners(0.15);
  LensCalibrator calibrator(kBoardColumns, kBoardRows);
  std::size_t number = 0;
  for (const test::BoardPose& pose : test::board_poses())
    EXPECT_EQ(calibrator.take(kBoardWidth, kBoardHeight, picture_of(pose, barrel)), Taken::kUsed) << number++;
  EXPECT_EQ(calibrator.take(kBoardWidth, kBoardHeight, picture_of(test::board_poses()[2], barrel)),
            Taken::kAlike);
  const std::vector<std::uint8_t> grey(std::size_t{kBoardWidth} * kBoardHeight, 90);
  EXPECT_EQ(calibrator.take(kBoardWidth, kBoardHeight, grey), Taken::kNoBoard);
  const LensCalibrator::Result result = calibrator.solve();
  EXPECT_EQ(result.error_px.size(), calibrator.used());
  EXPECT_LT(result.rms_px, 0.15);
  EXPECT_LT(result.focal_error, 0.003);
  // A shift of the axis and a turn of the camera look nearly alike to boards, so places are off by more than
  // corners are. A camera without distortion would be off by some fifty pixels.
  const Lens found(result.lens), truth(barrel.calibration(kStraightDeg));
  for (int y = 60; y < kBoardHeight - 60; y += 10) {
    for (int x = 60; x < kBoardWidth - 60; x += 10) {
      const Eigen::Vector2d plane = truth.plane_of({x, y});
      ASSERT_LT((found.pixel_of(plane) - Eigen::Vector2d(x, y)).norm(), 3) << x << " " << y;
    }
  }
  EXPECT_THROW((void)calibrator.take(320, 240, std::vector<std::uint8_t>(320 * 240)), UsageError);
}

TEST(LensCalibrator, RefusesWhatLeavesTheLensOpen) {
  const test::BarrelLens barrel = test::BarrelLens::of_corners(0.1);
  LensCalibrator few(kBoardColumns, kBoardRows);
  EXPECT_THAT(refusal(few), HasSubstr("0 pictures only: 8 at least"));
  // Never tilted.
  LensCalibrator flat(kBoardColumns, kBoardRows);
  for (const double x : {-5.4, 0.0, 5.4}) {
    for (const double y : {-4.0, 0.0, 4.0})
      (void)flat.take(kBoardWidth, kBoardHeight, picture_of({0, 0, 0, {x, y, 15}}, barrel));
  }
  ASSERT_GE(flat.used(), LensCalibrator::kLeastPictures);
  EXPECT_THAT(refusal(flat), HasSubstr("too much alike in all pictures"));
  // Always in the middle.
  LensCalibrator middle(kBoardColumns, kBoardRows);
  for (int i = 0; i < 9; ++i) {
    const double tilt = 0.5 * (i % 3 - 1), aside = 0.5 * (i / 3 - 1);
    (void)middle.take(kBoardWidth, kBoardHeight, picture_of({tilt, aside, 0.2 * i, {0, 0, 22}}, barrel));
  }
  ASSERT_GE(middle.used(), LensCalibrator::kLeastPictures);
  EXPECT_THAT(refusal(middle), HasSubstr("never near a corner of the picture"));
  EXPECT_THROW(LensCalibrator(2, 6), UsageError);
  EXPECT_THROW(LensCalibrator(6, 6), UsageError);
  EXPECT_THROW(LensCalibrator(6, 51), UsageError);
}

}  // namespace
}  // namespace kiroku::sim

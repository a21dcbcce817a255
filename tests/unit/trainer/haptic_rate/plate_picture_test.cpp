#include "trainer/haptic_rate/plate_picture.h"

#include <gtest/gtest.h>

namespace kiroku::trainer {
namespace {

TEST(PlatePicture, IsBlueUnderTheFirstFingerAndRedUnderTheLast) {
  const Plate plate;
  const sim::Picture picture = picture_of_press(plate, 5);
  int blue = 0, red = 0;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const std::uint8_t* pixel = picture.pixel(x, y);
      if (pixel[2] > 2 * pixel[0] && pixel[2] > 2 * pixel[1] && pixel[2] > 60) ++blue;
      if (pixel[0] > 3 * pixel[2] && pixel[0] > 3 * pixel[1] && pixel[0] > 60) ++red;
    }
  }
  EXPECT_GT(blue, 30);
  EXPECT_GT(red, 30);
}

TEST(PlatePicture, ColoursOnlyWhatIsTouched) {
  const Plate plate;
  const std::vector<sim::Pose> poses = plate.pressing(2, 0.5);
  const auto none = colours_of_touch(plate, poses, std::vector<double>{0, 0});
  EXPECT_EQ(std::ranges::count(none, none[0]), std::ranges::ssize(none));
  const auto one = colours_of_touch(plate, poses, std::vector<double>{0, 1});
  const auto coloured = std::ranges::ssize(one) - std::ranges::count(one, none[0]);
  EXPECT_GT(coloured, 5);
  EXPECT_LT(coloured, 60);
}

}  // namespace
}  // namespace kiroku::trainer

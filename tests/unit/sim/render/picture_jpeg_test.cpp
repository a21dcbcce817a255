#include "sim/render/picture_jpeg.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

TEST(PictureJpeg, IsAFileOfThePicturesSize) {
  const Picture picture(64, 48);
  const Bytes file = jpeg_of(picture, 80);
  ASSERT_GT(file.size(), 100U);
  EXPECT_EQ(file[0], std::byte{0xff});
  EXPECT_EQ(file[1], std::byte{0xd8});
  EXPECT_EQ(file[file.size() - 1], std::byte{0xd9});
  EXPECT_LT(file.size(), picture.rgb.size() / 4);
  EXPECT_THROW((void)jpeg_of(Picture(), 80), Error);
}

}  // namespace
}  // namespace kiroku::sim

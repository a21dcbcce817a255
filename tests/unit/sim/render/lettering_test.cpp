#include "sim/render/lettering.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/render/colour_map.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

int lit(const Picture& picture, int from_x, int to_x) {
  int count = 0;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = from_x; x < to_x; ++x) count += picture.pixel(x, y)[0] > 128 ? 1 : 0;
  }
  return count;
}

TEST(Lettering, DrawsWordsWhereTheyAreToBe) {
  Lettering lettering;
  Picture picture(200, 40);
  const int width = lettering.width_of("3.25 s", 20);
  EXPECT_GT(width, 40);
  EXPECT_LT(width, 90);
  lettering.draw(picture, "3.25 s", 50, 30, 20, {255, 255, 255});
  EXPECT_EQ(lit(picture, 0, 50), 0);
  EXPECT_GT(lit(picture, 50, 50 + width), 100);
  EXPECT_EQ(lit(picture, 51 + width, 200), 0);
}

TEST(Lettering, LeavesOutWhatReachesBeyondThePicture) {
  Lettering lettering;
  Picture picture(30, 12);
  lettering.draw(picture, "a long line of words", -20, 5, 20, {255, 255, 255});
  lettering.draw(picture, "M", 20, 60, 20, {255, 255, 255});
  EXPECT_GT(lit(picture, 0, 30), 0);
}

TEST(Lettering, ReadsUtf8AndBytesThatAreNone) {
  Lettering lettering;
  EXPECT_EQ(lettering.width_of("\xC3\xA4", 20), lettering.width_of("\xC3\xA4", 20));
  EXPECT_LT(lettering.width_of("\xC3\xA4", 20), lettering.width_of("\xC3\xA4\xC3\xA4", 20))
      << "one letter, not two";
  EXPECT_NEAR(lettering.width_of("\xC3\xA4", 20), lettering.width_of("a", 20), 1);
  EXPECT_EQ(lettering.width_of("\xFF", 20), lettering.width_of("?", 20));
  EXPECT_EQ(lettering.width_of("\xC3", 20), lettering.width_of("?", 20));
}

TEST(Lettering, CaptionsAreReadableOnLightAndDark) {
  Lettering lettering;
  Picture dark(200, 100), light(200, 100);
  std::ranges::fill(light.rgb, 255);
  draw_caption(lettering, dark, "step 1", "0.05 s");
  draw_caption(lettering, light, "step 1", "0.05 s");
  EXPECT_GT(lit(dark, 0, 200), 50);
  EXPECT_LT(lit(light, 0, 200), 200 * 100 - 50);
}

TEST(Lettering, ScaleRunsFromZeroBelowToTheLargestAbove) {
  Lettering lettering;
  Picture picture(300, 200);
  draw_stress_scale(lettering, picture, 2000);
  const int x = 300 - 11 * 2 / 3 - 5;
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(picture.pixel(x, 50)[c], viridis(1)[c]);
    EXPECT_EQ(picture.pixel(x, 149)[c], viridis(0)[c]);
  }
}

TEST(Lettering, SaysWhichFontIsMissing) {
  try {
    const Lettering lettering("/nonexistent/font.ttf");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("/nonexistent/font.ttf"));
    EXPECT_THAT(error.what(), HasSubstr("fonts-dejavu-core"));
  }
}

}  // namespace
}  // namespace kiroku::sim

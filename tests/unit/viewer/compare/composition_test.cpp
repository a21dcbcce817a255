#include "viewer/compare/composition.h"

namespace kiroku::compare {
namespace {

constexpr int kWidth = 64, kHeight = 48;

sim::Picture plain(const sim::Rgb& colour) {
  sim::Picture picture(kWidth, kHeight);
  for (std::size_t i = 0; i < picture.rgb.size(); ++i) picture.rgb[i] = colour[i % 3];
  return picture;
}

class CompositionTest : public testing::Test {
 protected:
  CompositionTest() {
    form_.width = kWidth;
    form_.height = kHeight;
    // The plan's tissue is in the upper half alone.
    for (int y = kHeight / 2; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) std::copy_n(form_.plan_background.begin(), 3, plan_.pixel(x, y));
    }
  }
  sim::Picture composed() {
    Composer composer(form_);
    EXPECT_EQ(composer.width() % 2, 0);
    EXPECT_EQ(composer.height() % 2, 0);
    return composer.compose(plan_, recording_, {"Plan", "Recording", "step 1", "HR 70"});
  }
  /// Of the lower picture's row `y`, below the line of times.
  static int red(const sim::Picture& picture, int x, int y) {
    return picture.pixel(x, (picture.height - kHeight) / 3 + y)[0];
  }

  CompositionForm form_;
  sim::Picture plan_ = plain({200, 0, 0}), recording_ = plain({100, 0, 0});
};

TEST_F(CompositionTest, PutsThemSideBySide) {
  const sim::Picture picture = composed();
  EXPECT_EQ(picture.width, 2 * kWidth + 8);
  EXPECT_EQ(red(picture, 5, 5), 200);
  EXPECT_EQ(red(picture, kWidth + 8 + 5, 5), 100);
}

TEST_F(CompositionTest, LaysThePlansTissueOverTheRecording) {
  form_.arrangement = Arrangement::kOverlay;
  form_.share = 0.3;
  const sim::Picture picture = composed();
  EXPECT_EQ(picture.width, kWidth);
  EXPECT_EQ(red(picture, 5, 5), 130);
  EXPECT_EQ(red(picture, 5, kHeight - 5), 100) << "what is none of the plan's tissue hides nothing";
}

TEST_F(CompositionTest, WipesAtALine) {
  form_.arrangement = Arrangement::kWipe;
  form_.share = 0.25;
  const sim::Picture picture = composed();
  EXPECT_EQ(red(picture, kWidth / 4 - 1, 5), 200);
  EXPECT_GT(red(picture, kWidth / 4, 5), 220);
  EXPECT_EQ(red(picture, kWidth / 4 + 1, 5), 100);
}

TEST_F(CompositionTest, WritesAroundThePictures) {
  form_.arrangement = Arrangement::kOverlay;
  const sim::Picture with = composed();
  Composer composer(form_);
  const sim::Picture without = composer.compose(plan_, recording_, {});
  const int band = (with.height - kHeight) / 3;
  for (int y = 0; y < with.height; ++y) {
    const bool same = std::equal(with.pixel(0, y), with.pixel(0, y) + 3 * kWidth, without.pixel(0, y));
    EXPECT_TRUE(same || y < band || y >= band + kHeight) << y;
  }
  EXPECT_NE(with.rgb, without.rgb);
}

TEST_F(CompositionTest, CautionsStandAboveEveryPictureInLinesThatFit) {
  form_.arrangement = Arrangement::kOverlay;
  const int without = Composer(form_).height();
  form_.cautions = {"The CT"};
  const int line = Composer(form_).height() - without;
  EXPECT_GT(line, 0);
  form_.cautions = {"The case was recorded by another plan than the one shown"};
  EXPECT_GE(Composer(form_).height(), without + 3 * line) << "64 pixels have no room for it in one line";
  Composer composer(form_);
  const sim::Picture picture = composer.compose(plan_, recording_, {});
  EXPECT_EQ(picture.height % 2, 0);
  int bright = 0;
  for (int y = 0; y < line; ++y) {
    for (int x = 0; x < kWidth; ++x) bright += picture.pixel(x, y)[0] > 200 ? 1 : 0;
  }
  EXPECT_GT(bright, 10);
  // Pictures are below all of it.
  const int above = Composer(form_).height() - without + line;
  EXPECT_EQ(picture.pixel(5, above + kHeight - 5)[0], 100);
}

}  // namespace
}  // namespace kiroku::compare

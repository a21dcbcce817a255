// What a search comes to, from the places that it found.
#include "sim/align/search_verdict.h"

#include <gtest/gtest.h>

namespace kiroku::sim {
namespace {

OutlineFit place(double misfit_px, double seen = 1, double supported = 0.95) {
  OutlineFit fit;
  fit.share_in_picture = 1;
  fit.agreement = 0.95;
  fit.seen = seen;
  fit.supported = supported;
  fit.misfit_px = misfit_px;
  return fit;
}

TEST(SearchVerdict, FindsTheOnlyPlaceThatExplainsThePicture) {
  const SearchVerdict verdict = verdict_of({place(1), place(2.5)}, {place(2.5)});
  EXPECT_EQ(verdict.why, WhyLost::kNotLost);
  ASSERT_TRUE(verdict.best);
  EXPECT_EQ(verdict.best->misfit_px, 1);
  EXPECT_EQ(verdict.rival_px, 2.5);
  EXPECT_EQ(verdict_of({place(1), place(1.4)}, {}).why, WhyLost::kAlike);
  EXPECT_EQ(verdict_of({}, {place(1)}).why, WhyLost::kNoOrgan);
}

TEST(SearchVerdict, AMirrorImageBehindOneUnderCoverRefusesThePicture) {
  const SearchVerdict verdict = verdict_of({place(1)}, {place(0.4, 0.4), place(1.2)});
  EXPECT_EQ(verdict.why, WhyLost::kMirrored) << name_of(verdict.why);
  EXPECT_EQ(verdict.rival_px, 1.2);
}

TEST(SearchVerdict, AMirrorImageBehindOneThatExplainsNothingRefusesThePicture) {
  OutlineFit of_other_colours = place(0.5);
  of_other_colours.agreement = 0.6;
  EXPECT_EQ(verdict_of({place(1)}, {of_other_colours, place(1.2)}).why, WhyLost::kMirrored);
}

TEST(SearchVerdict, APlaceUnderCoverNeitherFindsNorRivals) {
  EXPECT_EQ(verdict_of({place(0.3, 0.4)}, {}).why, WhyLost::kNoOrgan);
  const SearchVerdict verdict = verdict_of({place(0.3, 0.4), place(1)}, {place(0.3, 0.4)});
  EXPECT_EQ(verdict.why, WhyLost::kNotLost) << name_of(verdict.why);
  EXPECT_EQ(verdict.best->misfit_px, 1);
}

TEST(SearchVerdict, APlaceIsFoundAnewOnlyWhereHalfOfItsWholeOutlineShowsABorder) {
  EXPECT_EQ(verdict_of({place(1, 0.5, 0.75)}, {}).why, WhyLost::kNoOrgan);
  EXPECT_EQ(verdict_of({place(1, 0.65, 0.75)}, {}).why, WhyLost::kNoOrgan);
  EXPECT_EQ(verdict_of({place(1, 0.6, 0.9)}, {}).why, WhyLost::kNotLost);
}

}  // namespace
}  // namespace kiroku::sim

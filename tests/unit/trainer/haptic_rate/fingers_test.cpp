#include "trainer/haptic_rate/fingers.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

TEST(Fingers, AreANumberOrNames) {
  for (const std::string text :
       {"1", "5", "thumb", "little", "index+middle", "thumb+index+middle+third+little"})
    EXPECT_EQ(Fingers::of(text).text(), text);
  EXPECT_EQ(Fingers::of("middle+index"), Fingers::of("index+middle"));
  EXPECT_EQ(Fingers::of("2"), Fingers(2));
  EXPECT_NE(Fingers::of("2"), Fingers::of("thumb+index"));
  EXPECT_EQ(Fingers::of("index+middle").count(), 2U);
  EXPECT_EQ(Fingers(1).which(), std::vector{Finger::kIndex});
  EXPECT_EQ(Fingers(2).which(), (std::vector{Finger::kThumb, Finger::kIndex}));
  EXPECT_EQ(Fingers::of("middle+third").which(), (std::vector{Finger::kMiddle, Finger::kThird}));
  EXPECT_EQ(Fingers::of("index+middle").in_words(), "index and middle fingers");
  EXPECT_EQ(Fingers::of("little").in_words(), "little finger");
  EXPECT_EQ(Fingers(1).in_words(), "1 finger");
}

TEST(Fingers, RefusesWhatNoHandHas) {
  for (const std::string text : {"0", "6", "", "ring", "index+", "index+index", "index, middle", "12"})
    EXPECT_THROW((void)Fingers::of(text), UsageError) << text;
  EXPECT_THROW(Fingers(0), UsageError);
  EXPECT_THROW(Fingers(std::vector<Finger>{}), UsageError);
}

}  // namespace
}  // namespace kiroku::trainer

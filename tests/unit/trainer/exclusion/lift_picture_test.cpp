#include "trainer/exclusion/lift_picture.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/render/colour_map.h"
#include "tests/unit/trainer/made_object.h"

namespace kiroku::trainer {
namespace {

/// How many pixels have viridis' yellow: much more green and red than blue.
std::ptrdiff_t yellow_pixels(const sim::Picture& picture) {
  std::ptrdiff_t found = 0;
  for (std::size_t i = 0; i < picture.rgb.size(); i += 3) {
    const int red = picture.rgb[i], green = picture.rgb[i + 1], blue = picture.rgb[i + 2];
    if (red > 90 && green > 90 && blue < green / 2) ++found;
  }
  return found;
}

TEST(LiftPicture, ShowsMoreStressInItsColourTheLowerTheScaleEnds) {
  const OrganObject& object = made_object(ObjectKind::kLiver, 900);
  const sim::ElasticBody body(object.mesh, object.materials, object.constraints);
  const sim::ContactBody contact(body);
  const ExclusionTask task = exclusion_task(ObjectKind::kLiver);
  const LiftedObject lifted = lift_border(contact, task, 3, LiftManner::kSpread, 0.01);
  ASSERT_EQ(lifted.von_mises_at_nodes_pa.size(), object.mesh.nodes.size());
  EXPECT_LT(lifted.von_mises_95_pa, lifted.high_von_mises_pa);
  EXPECT_LT(lifted.high_von_mises_pa, lifted.largest_von_mises_pa);
  EXPECT_GE(lifted.wrist_n, std::ranges::max(lifted.forces_n));
  const auto from_below = [&](double top_pa) {
    return yellow_pixels(picture_from_below(object.mesh, task, lifted, top_pa));
  };
  EXPECT_GT(from_below(lifted.von_mises_95_pa), 4 * from_below(lifted.largest_von_mises_pa));
  const sim::Picture cut =
      picture_cut_open(object.mesh, task, lifted, lifted.von_mises_95_pa, sim::Vector3::Zero());
  EXPECT_EQ(cut.width, 480);
  EXPECT_GT(yellow_pixels(cut), 50);
}

TEST(LiftPicture, ASheetHasItsPicturesInRowsAndTheScaleWhereNoneIs) {
  sim::Picture one(160, 100), other(160, 100);
  std::ranges::fill(one.rgb, std::uint8_t{40});
  std::ranges::fill(other.rgb, std::uint8_t{60});
  const sim::Picture sheet = sheet_of({{"", one}, {"", other}, {"", {}}, {"", one}}, 2, 1000);
  ASSERT_EQ(sheet.width, 320);
  ASSERT_EQ(sheet.height, 200);
  EXPECT_EQ(*sheet.pixel(80, 50), 40);
  EXPECT_EQ(*sheet.pixel(240, 50), 60);
  EXPECT_EQ(*sheet.pixel(240, 150), 40);
  // The scale's upper end, viridis' yellow, is in the cell without a picture alone.
  EXPECT_GT(yellow_pixels(sheet), 20);
  EXPECT_EQ(yellow_pixels(sheet_of({{"", one}, {"", other}, {"", {}}}, 2, 1000)), yellow_pixels(sheet));
  EXPECT_THROW((void)sheet_of({{"", one}, {"", sim::Picture(10, 10)}}, 2, 1000), UsageError);
  EXPECT_THROW((void)sheet_of({{"", {}}}, 2, 1000), UsageError);
}

}  // namespace
}  // namespace kiroku::trainer

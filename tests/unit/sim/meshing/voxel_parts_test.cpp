#include "sim/meshing/voxel_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::sim {
namespace {

using testing::ElementsAre;

/// Two slices of 5 x 3.
LabelMap some_map() {
  LabelMap map;
  map.grid.size = {5, 3, 2};
  map.grid.spacing_m = {0.001, 0.002, 0.003};
  map.grid.origin_m = {1, 2, 3};
  map.labels = {0, 0, 0, 0, 0,  //
                0, 1, 2, 0, 3,  //
                0, 0, 0, 0, 0,  //
                0, 0, 0, 0, 0,  //
                0, 0, 2, 0, 0,  //
                0, 0, 0, 3, 3};
  return map;
}

TEST(VoxelParts, HangTogetherByFaces) {
  const VoxelParts by_label = parts_by_label(some_map());
  ASSERT_EQ(by_label.parts.size(), 4U);
  EXPECT_EQ(by_label.parts[1].label, 2);
  EXPECT_EQ(by_label.parts[1].voxels, 2U);
  EXPECT_THAT(by_label.parts[0].central, ElementsAre(1U, 1U, 0U));
  EXPECT_EQ(by_label.of_voxel[7], 2U);
  EXPECT_EQ(by_label.of_voxel[22], 2U);
  const VoxelParts body = parts_of_body(some_map());
  ASSERT_EQ(body.parts.size(), 3U);
  EXPECT_EQ(body.parts[0].voxels, 3U);
}

TEST(VoxelParts, OfTheBodyAreKeptByTheirSize) {
  LabelMap map = some_map();
  const RemovedParts removed = keep_largest_parts(map, 1);
  EXPECT_EQ(removed.parts, 2U);
  EXPECT_EQ(removed.voxels, 3U);
  EXPECT_EQ(std::ranges::count(map.labels, 3), 0);
  EXPECT_EQ(std::ranges::count(map.labels, 2), 2);
  EXPECT_EQ(keep_largest_parts(map, 1).parts, 0U);
}

TEST(VoxelParts, AreCroppedWithAMarginAndStayInTheirPlace) {
  const LabelMap map = some_map();
  const LabelMap box = cropped(map, 1);
  EXPECT_THAT(box.grid.size, ElementsAre(6U, 4U, 4U));
  EXPECT_EQ(box.labels[box.grid.offset(1, 1, 1)], 1);
  EXPECT_TRUE(box.grid.patient_m({1, 1, 1}).isApprox(map.grid.patient_m({1, 1, 0})));
  EXPECT_EQ(std::ranges::count(box.labels, 3), 3);
  LabelMap empty = map;
  empty.labels.assign(30, 0);
  EXPECT_EQ(cropped(empty, 1).labels.size(), 1U);
}

}  // namespace
}  // namespace kiroku::sim

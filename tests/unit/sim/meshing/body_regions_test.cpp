#include "sim/meshing/body_regions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

LabelMap row_of(std::vector<std::uint16_t> labels) {
  LabelMap map;
  map.grid.size = {labels.size(), 1, 1};
  map.labels = std::move(labels);
  return map;
}

TEST(BodyRegions, ReadsThresholds) {
  EXPECT_EQ(parse_hu_interval("-200:100.5").least, -200);
  EXPECT_EQ(parse_hu_interval("-200:-100.5").greatest, -100.5);
  for (const char* text : {"", ":", "1", "1:", ":1", "2:1", "a:b", "1:2:3", "nan:1", "1:inf", "1 :2"}) {
    EXPECT_THROW((void)parse_hu_interval(text), UsageError) << text;
  }
}

TEST(BodyRegions, ReadsRegionsOfLabels) {
  const RegionLabels region = parse_region_labels("vessels=64,70-72");
  EXPECT_EQ(region.name, "vessels");
  ASSERT_EQ(region.labels.size(), 2U);
  EXPECT_EQ(region.labels[0].first, 64);
  EXPECT_EQ(region.labels[1].last, 72);
  for (const char* text :
       {"", "a", "a=", "=1", "a=0", "a=1,", "a=,1", "a=2-1", "a=1-", "a=70000", "a=b", "a\"=1", "a\n=1"}) {
    EXPECT_THROW((void)parse_region_labels(text), UsageError) << text;
  }
}

TEST(BodyRegions, AreCutOutByThreshold) {
  Volume volume;
  volume.grid.size = {5, 1, 1};
  volume.hu = {-1000, -200, 0, 100, 101};
  const BodyRegions body = regions_of_threshold(volume, {-200, 100});
  EXPECT_THAT(body.map.labels, ElementsAre(0, 1, 1, 1, 0));
  EXPECT_THAT(body.names, ElementsAre(Pair(1, "body")));
}

TEST(BodyRegions, TakeTheirNumbersFromTheirOrder) {
  const BodyRegions body = regions_of_labels(row_of({0, 5, 64, 70, 9, 71}),
                                             {{"liver", {{5, 5}}}, {"vessels", {{64, 64}, {70, 72}}}});
  EXPECT_THAT(body.map.labels, ElementsAre(0, 1, 2, 2, 0, 2));
  EXPECT_THAT(body.names, ElementsAre(Pair(1, "liver"), Pair(2, "vessels")));
}

TEST(BodyRegions, AreTheLabelsThemselvesWhereNoneIsNamed) {
  const BodyRegions body = regions_of_labels(row_of({0, 5, 64}), {});
  EXPECT_THAT(body.map.labels, ElementsAre(0, 5, 64));
  EXPECT_THAT(body.names, ElementsAre(Pair(5, "label 5"), Pair(64, "label 64")));
}

TEST(BodyRegions, NameWhatIsNotThere) {
  try {
    (void)regions_of_labels(row_of({0, 5, 6, 7, 64}), {{"liver", {{5, 5}}}, {"kidney", {{2, 3}}}});
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("the region 'kidney' is there within the volume; the labels there are 5-7, 64"));
  }
}

TEST(BodyRegions, PutTheTumourIntoTheOrgan) {
  VolumeFile volume;
  volume.format = "DICOM";
  volume.volume.grid.size = {5, 5, 1};
  volume.instance_uids = {"1.2"};
  BodyRegions body{{volume.volume.grid, std::vector<std::uint16_t>(25, 1)}, {{1, "lung"}}};
  ContourFile contours;
  contours.readings = {{{{"1.2", true, {{0, 0}, {4, 0}, {4, 4}, {0, 4}}}}}};
  add_contours(body, contours, volume);
  EXPECT_THAT(body.names, ElementsAre(Pair(1, "lung"), Pair(2, "tumour")));
  EXPECT_EQ(std::ranges::count(body.map.labels, 2), 9);
  contours.readings.resize(3);
  EXPECT_THROW(add_contours(body, contours, volume), Error);
}

TEST(Organs, AreFoundByName) {
  EXPECT_EQ(organ_named("liver").labels.first, 5);
  EXPECT_EQ(organ_named("lung").pieces, 2U);
  try {
    (void)organ_named("lungs");
    FAIL();
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("no organ is called 'lungs'; there are spleen, right-kidney"));
  }
}

}  // namespace
}  // namespace kiroku::sim

#include "sim/volume/contours.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string contour(const std::string& uid, const std::vector<std::array<int, 2>>& points,
                    const std::string& inclusion = "TRUE") {
  std::string text = "<roi><imageZposition>-1.0 </imageZposition><imageSOP_UID>" + uid +
                     "</imageSOP_UID><inclusion>" + inclusion + "</inclusion>";
  for (const auto& [x, y] : points) {
    text += "<edgeMap><xCoord>" + std::to_string(x) + "</xCoord><yCoord>" + std::to_string(y) +
            "</yCoord></edgeMap>";
  }
  return text + "</roi>";
}
std::string reading(const std::string& contours) {
  return "<readingSession><unblindedReadNodule>" + contours +
         "</unblindedReadNodule><nonNodule><imageSOP_UID>1</imageSOP_UID></nonNodule></readingSession>";
}
std::string document(const std::string& readings) {
  return "<?xml version=\"1.0\"?>\n<LidcReadMessage xmlns=\"http://www.nih.gov\"><ResponseHeader>"
         "<SeriesInstanceUid>1.9</SeriesInstanceUid></ResponseHeader>\n" +
         readings + "</LidcReadMessage>";
}
const std::vector<std::array<int, 2>> kDiamond{{3, 1}, {4, 2}, {5, 3}, {4, 4},
                                               {3, 5}, {2, 4}, {1, 3}, {2, 2}};
const std::vector<std::array<int, 2>> kCorners{
    {1, 1}, {5, 1}, {5, 5}, {1, 5}};  // only corners: what lies between is drawn

VolumeFile volume_of_two_slices() {
  VolumeFile file;
  file.volume.grid.size = {8, 7, 2};
  file.format = "DICOM";
  file.series_uid = "1.9";
  file.instance_uids = {"1.9.1", "1.9.2"};
  return file;
}

std::vector<std::size_t> voxels(const std::string& readings) {
  return voxels_within(parse_contours(document(readings), "c.xml"), volume_of_two_slices());
}

std::string refusal(const std::string& xml) {
  try {
    (void)voxels_within(parse_contours(xml, "c.xml"), volume_of_two_slices());
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(Contours, EncloseTheirInsideWithoutTheLine) {
  // Rows of 8: the diamond holds (3, 2), (2..4, 3), (3, 4) of the second slice.
  EXPECT_THAT(voxels(reading(contour("1.9.2", kDiamond))),
              ElementsAre(56 + 19U, 56 + 26U, 56 + 27U, 56 + 28U, 56 + 35U));
  EXPECT_EQ(voxels(reading(contour("1.9.1", kCorners))).size(), 9U);
}

TEST(Contours, LeaveOutHoles) {
  EXPECT_EQ(voxels(reading(contour("1.9.1", kDiamond, "FALSE") + contour("1.9.1", kCorners))).size(), 9U - 5);
}

TEST(Contours, NeedHalfOfTheRadiologists) {
  const std::string diamond = reading(contour("1.9.1", kDiamond)),
                    square = reading(contour("1.9.1", kCorners));
  const std::string nothing = reading(contour("1.9.1", {{3, 3}}));
  EXPECT_EQ(voxels(diamond + square).size(), 9U);
  EXPECT_EQ(voxels(diamond + square + nothing).size(), 5U);
  EXPECT_EQ(voxels(diamond + nothing + nothing).size(), 0U);
  EXPECT_EQ(parse_contours(document(diamond + nothing), "c.xml").points_alone, 1U);
}

TEST(Contours, RefuseWhatCannotBePlaced) {
  EXPECT_THAT(refusal("<a"), HasSubstr("cannot read c.xml, line 1"));
  EXPECT_THAT(refusal("<a/>"), HasSubstr("no LidcReadMessage"));
  EXPECT_THAT(refusal(document("")), HasSubstr("no contour of more than one point"));
  EXPECT_THAT(refusal(document(reading(contour("1.8.1", kDiamond)))),
              HasSubstr("1.8.1 is not in the series 1.9"));
  EXPECT_THAT(refusal(document(reading(contour("1.9.1", {{3, 1}, {8, 3}, {3, 3}})))),
              HasSubstr("(8, 3) is beyond"));
  EXPECT_THAT(refusal(document(reading(contour("", kDiamond)))), HasSubstr("no imageSOP_UID"));
  std::string word = document(reading(contour("1.9.1", kDiamond)));
  word.replace(word.find("<xCoord>3"), 9, "<xCoord>c");
  EXPECT_THAT(refusal(word), HasSubstr("no whole xCoord"));
  VolumeFile nifti = volume_of_two_slices();
  nifti.instance_uids.clear();
  nifti.format = "NIfTI";
  EXPECT_THROW((void)voxels_within(parse_contours(document(reading(contour("1.9.1", kDiamond))), "c"), nifti),
               Error);
}

}  // namespace
}  // namespace kiroku::sim

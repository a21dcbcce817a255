#include "sim/drr/dicom_radiograph.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/dicom_writer.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::sim {
namespace {

using ::testing::ElementsAre;
using ::testing::FloatNear;
using ::testing::HasSubstr;

class DicomRadiograph : public ::testing::Test {
 protected:
  /// A fluoroscope's picture: no place in the patient, no rescaling.
  [[nodiscard]] static test::DicomSlice picture() {
    test::DicomSlice slice;
    slice.rows = 2;
    slice.columns = 3;
    slice.is_signed = false;
    slice.bits_stored = 12;
    slice.stored = {100, 200, 300, 400, 500, 4095};
    slice.elements = {{"(0008,0060)", "XA"}, {"(0020,0032)", ""}, {"(0020,0037)", ""},
                      {"(0028,0030)", ""},   {"(0028,1052)", ""}, {"(0028,1053)", ""}};
    return slice;
  }
  /// A linear accelerator's: 1000 and 1500 mm, half-millimetre pixels, at 90 degrees.
  [[nodiscard]] static test::DicomSlice portal() {
    test::DicomSlice slice = picture();
    slice.elements["(0008,0060)"] = "RTIMAGE";
    slice.elements["(0018,5100)"] = "HFS";
    slice.elements["(3002,0011)"] = "0.5\\0.25";
    slice.elements["(3002,0012)"] = "-0.25\\0.25";
    slice.elements["(3002,0022)"] = "1000";
    slice.elements["(3002,0026)"] = "1500";
    slice.elements["(300A,011E)"] = "90";
    slice.elements["(300A,012C)"] = "10\\20\\-30";
    return slice;
  }
  [[nodiscard]] std::filesystem::path written(const test::DicomSlice& slice) const {
    const std::filesystem::path file = folder_ / "picture.dcm";
    test::write_dicom(file, slice);
    return file;
  }
  [[nodiscard]] static std::string refusal(const std::function<void()>& read) {
    try {
      read();
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing was refused";
  }
  [[nodiscard]] std::string unusable(const test::DicomSlice& slice) const {
    const auto file = written(slice);
    return refusal([&] { read_dicom_geometry(file); });
  }

  test::TemporaryFolder folder_;
};

TEST_F(DicomRadiograph, IsLightWhereMuchAttenuates) {
  const auto values = [this](const test::DicomSlice& slice, std::optional<Polarity> stated = {}) {
    return read_dicom_radiograph(written(slice), stated).values;
  };
  test::DicomSlice slice = picture();
  const auto as_stored = ElementsAre(0, 100, 200, 300, 400, 3995);
  const auto inverted = ElementsAre(3995, 3895, 3795, 3695, 3595, 0);
  const ProjectionImage image = read_dicom_radiograph(written(slice));
  EXPECT_EQ(image.columns, 3U);
  EXPECT_EQ(image.rows, 2U);
  EXPECT_THAT(image.values, as_stored);
  EXPECT_THAT(values(slice, Polarity::kBoneBlack), inverted);
  slice.elements["(0028,0004)"] = "MONOCHROME1";
  EXPECT_THAT(values(slice), inverted);
  EXPECT_THAT(values(slice, Polarity::kBoneWhite), as_stored);
}

TEST_F(DicomRadiograph, TheSignOfItsNumbersGoesBeforeHowItIsShown) {
  test::DicomSlice slice = picture();
  slice.elements["(0028,1041)"] = "1";  // greater numbers: more rays arrived
  EXPECT_THAT(read_dicom_radiograph(written(slice)).values, ElementsAre(3995, 3895, 3795, 3695, 3595, 0));
}

TEST_F(DicomRadiograph, IntensitiesBecomeLineIntegrals) {
  test::DicomSlice slice = picture();
  slice.stored = {0, 1000, 100, 1, 500, 10};
  slice.elements["(0028,1040)"] = "LIN";
  slice.elements["(0028,1041)"] = "1";
  const auto near = [](double part) { return FloatNear(static_cast<float>(-std::log(part)), 1e-5F); };
  EXPECT_THAT(read_dicom_radiograph(written(slice)).values,
              ElementsAre(near(0.001), near(1), near(0.1), near(0.001), near(0.5), near(0.01)));
  for (std::uint16_t& value : slice.stored) value = static_cast<std::uint16_t>(4095 - value);
  slice.elements["(0028,1041)"] = "-1";
  EXPECT_THAT(read_dicom_radiograph(written(slice)).values,
              ElementsAre(near(0.001), near(1), near(0.1), near(0.001), near(0.5), near(0.01)));
}

TEST_F(DicomRadiograph, SeveralPicturesSayWhenTheyWereTaken) {
  test::DicomSlice slice = picture();
  slice.stored.insert(slice.stored.end(), {100, 101, 102, 103, 104, 105});
  slice.stored.insert(slice.stored.end(), {106, 107, 108, 109, 110, 90});
  slice.elements["(0028,0008)"] = "3";
  const auto times = [&] { return read_dicom_radiographs(written(slice)).times_s; };
  EXPECT_TRUE(times().empty());
  slice.elements["(0018,0040)"] = "10";  // cine rate
  EXPECT_THAT(times(), ElementsAre(0, 0.1, 0.2));
  slice.elements["(0018,1063)"] = "250";  // frame time
  EXPECT_THAT(times(), ElementsAre(0, 0.25, 0.5));
  slice.elements["(0018,1065)"] = "0\\125\\500";  // frame time vector
  EXPECT_THAT(times(), ElementsAre(0, 0.125, 0.625));
  const DicomRadiographs read = read_dicom_radiographs(written(slice));
  ASSERT_EQ(read.images.size(), 3U);
  // From the least of all on.
  EXPECT_THAT(read.images[0].values, ElementsAre(10, 110, 210, 310, 410, 4005));
  EXPECT_THAT(read.images[2].values, ElementsAre(16, 17, 18, 19, 20, 0));
  EXPECT_THAT(refusal([&] { read_dicom_radiograph(written(slice)); }),
              HasSubstr("holds 3 pictures in one file"));
  slice.compression = test::DicomCompression::kRunLength;
  slice.elements["(0028,0008)"] = "90000000";
  EXPECT_THAT(refusal([&] { read_dicom_radiographs(written(slice)); }), HasSubstr("split the file"));
  slice.compression = test::DicomCompression::kNone;
  slice.elements["(0028,0008)"] = "4";
  EXPECT_THAT(refusal([&] { read_dicom_radiographs(written(slice)); }), HasSubstr("its pixels are cut off"));
}

TEST_F(DicomRadiograph, OnePictureIsASeriesOfOne) {
  const DicomRadiographs read = read_dicom_radiographs(written(picture()));
  EXPECT_EQ(read.images.size(), 1U);
  EXPECT_THAT(read.times_s, ElementsAre(0));
}

TEST_F(DicomRadiograph, APortalImageSaysWhereSourceAndDetectorStood) {
  const GeometryDocument machine = read_dicom_geometry(written(portal()));
  ASSERT_TRUE(machine.gantry);
  EXPECT_EQ(machine.gantry->gantry_deg, 90);
  EXPECT_TRUE(machine.geometry.source_m().isApprox(Vector3(1.01, 0.02, -0.03), 1e-12));
  // Three columns of 0.25 mm and two rows of 0.5 mm about the middle.
  EXPECT_NEAR(machine.gantry->size_m[0], 0.00075, 1e-12);
  EXPECT_NEAR(machine.gantry->size_m[1], 0.001, 1e-12);
  const auto middle = machine.geometry.project(Vector3(0.01, 0.02, -0.03));
  ASSERT_TRUE(middle);
  EXPECT_NEAR(middle->column, 1, 1e-9);
  EXPECT_NEAR(middle->row, 0.5, 1e-9);
}

TEST_F(DicomRadiograph, ADetectorAsideIsRead) {
  test::DicomSlice slice = portal();
  slice.elements["(3002,0012)"] = "1.75\\3.25";  // 2 mm and 3 mm further
  const ProjectionGeometry geometry = read_dicom_geometry(written(slice)).geometry;
  const auto middle = geometry.project(Vector3(0.01, 0.02, -0.03));
  ASSERT_TRUE(middle);
  EXPECT_NEAR(middle->column, 1 - 2 / 0.25, 1e-9);
  EXPECT_NEAR(middle->row, 0.5 + 3 / 0.5, 1e-9);
  // The first pixel's centre is at 1.75 mm along the rows, which run to the back at 90 degrees.
  const SourceRay ray = geometry.ray(0, 0);
  const double to_detector = 1.5 / -ray.direction.x();
  const Vector3 pixel = ray.origin_m + to_detector * ray.direction;
  EXPECT_NEAR(pixel.y(), 0.02 + 0.00175, 1e-12);
  EXPECT_NEAR(pixel.z(), -0.03 + 0.00325, 1e-12);
}

TEST_F(DicomRadiograph, WhatSaysNotEnoughIsRefused) {
  EXPECT_THAT(unusable(picture()), HasSubstr("its modality is 'XA'; only an RT Image"));
  test::DicomSlice slice = portal();
  slice.elements["(3002,0026)"] = "";
  EXPECT_THAT(unusable(slice), HasSubstr("it lacks RTImageSID (3002,0026)"));
  slice = portal();
  slice.elements["(0018,5100)"] = "FFS";
  EXPECT_THAT(unusable(slice), HasSubstr("the patient lay 'FFS'; only head first and supine"));
  slice = portal();
  slice.elements["(300A,0122)"] = "30";
  EXPECT_THAT(unusable(slice), HasSubstr("the table is turned by 30 degrees"));
  slice = portal();
  slice.elements["(3002,0026)"] = "900";
  EXPECT_THAT(unusable(slice), HasSubstr("it must be behind it"));
  slice = picture();
  slice.elements["(0028,0008)"] = "40";
  const auto film = written(slice);
  EXPECT_THAT(refusal([&] { read_dicom_radiograph(film); }), HasSubstr("it holds 40 pictures in one file"));
}

}  // namespace
}  // namespace kiroku::sim

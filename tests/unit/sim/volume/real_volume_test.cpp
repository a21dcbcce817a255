// Volumes that nobody here wrote.
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/volume/contours.h"
#include "sim/volume/dicom_series.h"
#include "sim/volume/jpeg2000.h"
#include "sim/volume/volume_reader.h"
#include "tests/support/unpacked.h"

namespace kiroku::sim {
namespace {

using test::shared_data;
using test::Unpacked;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

std::string refusal(const std::filesystem::path& path) {
  try {
    (void)read_volume(path, {});
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

/// Mean HU where the label lies, and how many voxels that is.
std::pair<double, std::size_t> mean_hu(const Volume& volume, const LabelMap& labels, std::uint16_t first,
                                       std::uint16_t last) {
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t offset = 0; offset < volume.hu.size(); ++offset) {
    if (labels.labels[offset] < first || labels.labels[offset] > last) continue;
    sum += double(volume.hu[offset]);
    ++count;
  }
  return {sum / double(count), count};
}

TEST(RealVolume, LungCtLiesUnderItsLabelsAndContours) {
  KIROKU_NEEDS_SHARED_DATA("sim/lung-ct");
  const Unpacked folder("sim/lung-ct/lidc-idri-0001-dicom.tar.xz");
  const VolumeFile file = read_volume(folder.path(), {});
  const Grid& grid = file.volume.grid;
  EXPECT_THAT(grid.size, ElementsAre(512U, 512U, 133U));
  EXPECT_TRUE(grid.spacing_m.isApprox(Vector3(0.000703125, 0.000703125, 0.0025), 1e-9));
  EXPECT_EQ(orientation_code(grid), "LPS");
  EXPECT_EQ(file.patient_position, "FFS");
  EXPECT_THAT(file.findings, Contains(HasSubstr("voxels are padding")));
  EXPECT_GE(range_of(file.volume).least, -1024);
  EXPECT_EQ(range_of(file.volume).greatest, 3071);

  // Its rows run the other way: taken index by index, the lungs would lie in the back's muscles.
  const LabelMap stored = read_label_map(shared_data("sim/lung-ct/mask_totalsegmentator.nii.gz"));
  EXPECT_EQ(orientation_code(stored.grid), "LAS");
  const LabelMap labels = resampled(stored, grid);
  const auto [lung_hu, lung_voxels] = mean_hu(file.volume, labels, 10, 14);
  EXPECT_LT(lung_hu, -750);
  EXPECT_NEAR(double(lung_voxels) * grid.spacing_m.prod() * 1e3, 3.7, 0.2);  // litres
  const auto [liver_hu, liver_voxels] = mean_hu(file.volume, labels, 5, 5);
  EXPECT_NEAR(liver_hu, 105, 40);
  EXPECT_GT(liver_voxels, 100'000U);

  // The tumour is dense, within the lung, and as large as its four radiologists say.
  const ContourFile contours = read_contours(shared_data("sim/lung-ct/069.xml"));
  EXPECT_EQ(contours.readings.size(), 4U);
  EXPECT_EQ(contours.points_alone, 9U);
  const std::vector<std::size_t> tumour = voxels_within(contours, file);
  double sum = 0;
  for (const std::size_t voxel : tumour) sum += double(file.volume.hu[voxel]);
  EXPECT_NEAR(sum / double(tumour.size()), 0, 100);
  EXPECT_NEAR(double(tumour.size()) * grid.spacing_m.prod() * 1e6, 7, 3);  // ml
}

TEST(RealVolume, ReadsJpeg2000) {
  KIROKU_NEEDS_SHARED_DATA("sim/dicom-odd/jpeg2000");
  const VolumeFile file = read_volume(shared_data("sim/dicom-odd/jpeg2000"), {});
  EXPECT_THAT(file.volume.grid.size, ElementsAre(512U, 512U, 20U));
  EXPECT_NEAR(file.volume.grid.spacing_m.z(), 0.002, 1e-12);
  EXPECT_EQ(range_of(file.volume).least, -1024);
  EXPECT_EQ(range_of(file.volume).greatest, 1839);
  EXPECT_THAT(file.findings, Contains(HasSubstr("no SeriesInstanceUID")));
}

TEST(RealVolume, NamesAJpeg2000PictureThatIsCutOff) {
  KIROKU_NEEDS_SHARED_DATA("sim/dicom-odd/jpeg2000");
  const auto first = *std::filesystem::directory_iterator(shared_data("sim/dicom-odd/jpeg2000"));
  const Bytes file = test::read_whole(first.path());
  constexpr std::array<std::byte, 4> kStart{std::byte{0xff}, std::byte{0x4f}, std::byte{0xff},
                                            std::byte{0x51}};
  const auto found = std::search(file.begin(), file.end(), kStart.begin(), kStart.end());
  ASSERT_NE(found, file.end());
  const ByteView picture(found, file.end());
  EXPECT_EQ(decode_jpeg2000(picture, 512, 512, "it").size(), 512U * 512);
  for (const std::size_t kept : {std::size_t{0}, std::size_t{3}, std::size_t{60}, picture.size() / 2}) {
    EXPECT_THROW((void)decode_jpeg2000(picture.first(kept), 512, 512, "it"), Error) << kept;
  }
  EXPECT_THROW((void)decode_jpeg2000(picture, 512, 511, "it"), Error);
}

TEST(RealVolume, RefusesTheTiltedGantryWithItsNumbersAndResamplesIt) {
  KIROKU_NEEDS_SHARED_DATA("sim/dicom-odd/gantry-tilt.tar.xz");
  const Unpacked folder("sim/dicom-odd/gantry-tilt.tar.xz");
  EXPECT_THAT(refusal(folder.path()),
              AllOf(HasSubstr("1.081 to 6.999 mm apart"), HasSubstr("tilted by 18.5 degrees"),
                    HasSubstr("the header says 18.5")));
  const VolumeFile file = read_volume(folder.path(), {"", true});
  EXPECT_NEAR(oblique_angle_rad(file.volume.grid) * 180 / std::numbers::pi, 18.5, 0.01);
  EXPECT_NEAR(file.volume.grid.spacing_m.z(), 0.00108, 1e-5);
  EXPECT_THAT(file.findings, Contains(HasSubstr("resampled to a regular grid")));
  EXPECT_TRUE(std::ranges::all_of(file.volume.hu, [](float hu) { return std::isfinite(hu); }));
}

TEST(RealVolume, ReadsASeriesWithTheFewestTags) {
  KIROKU_NEEDS_SHARED_DATA("sim/dicom-odd/minimal-tags.tar.xz");
  const Unpacked folder("sim/dicom-odd/minimal-tags.tar.xz");
  const VolumeFile file = read_volume(folder.path(), {});
  EXPECT_THAT(file.volume.grid.size, ElementsAre(512U, 512U, 2U));
  EXPECT_EQ(file.padding_voxels, 112504U);
  EXPECT_THAT(file.findings, Contains(HasSubstr("no DICOM picture")));
}

TEST(RealVolume, AbdominalNiftiLiesUnderItsLabels) {
  KIROKU_NEEDS_SHARED_DATA("sim/abdomen");
  const VolumeFile file = read_volume(shared_data("sim/abdomen/example_ct_sm.nii.gz"), {});
  const LabelMap labels = read_label_map(shared_data("sim/abdomen/example_seg.nii.gz"));
  EXPECT_TRUE(same_places(labels.grid, file.volume.grid));
  EXPECT_NEAR(mean_hu(file.volume, labels, 5, 5).first, 50, 20);
}

TEST(RealVolume, MetaImagesOfOnePatientHaveLungsOfTheirVolumes) {
  KIROKU_NEEDS_SHARED_DATA("sim/lung-pair");
  for (const auto& [name, litres] :
       {std::pair{"3DCT_lung_baseline_mask.mha", 3.36}, {"3DCT_lung_followup_mask.mha", 3.97}}) {
    const LabelMap mask = read_label_map(shared_data("sim/lung-pair") / name);
    const auto voxels = double(mask.labels.size()) - double(std::ranges::count(mask.labels, 0));
    EXPECT_NEAR(voxels * mask.grid.spacing_m.prod() * 1e3, litres, 0.01) << name;
  }
}

}  // namespace
}  // namespace kiroku::sim

#include "sim/meshing/lung_mask.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/volume/volume_reader.h"
#include "tests/support/unpacked.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

/// A chest of 2 mm voxels: two balls of lung with a vessel in each, a windpipe between them that ends in
/// both, air around.
double chest_hu(const Vector3& at_mm) {
  const double radius_mm = std::hypot(at_mm.x() / 1.3, at_mm.y());
  if (radius_mm > 70) return -1000;
  if (std::hypot(at_mm.x(), at_mm.y()) < 8 && at_mm.z() > 0) return -1000;
  if (std::abs(at_mm.z()) < 5 && std::abs(at_mm.y()) < 5 && std::abs(at_mm.x()) < 30) return -1000;
  for (const double side : {-40.0, 40.0}) {
    const Vector3 from_middle = at_mm - Vector3(side, 0, 0);
    if (std::hypot(from_middle.x(), from_middle.y()) < 4) return 50;
    if (from_middle.norm() < 32) return -800;
  }
  return 20;
}

Volume chest(bool head_first) {
  Volume volume;
  volume.grid.size = {100, 76, 40};
  volume.grid.spacing_m = Vector3::Constant(0.002);
  volume.grid.direction(2, 2) = head_first ? -1 : 1;
  volume.grid.origin_m = volume.grid.direction * Vector3(-0.099, -0.075, -0.039);
  for (std::size_t offset = 0; offset < volume.grid.voxels(); ++offset) {
    const Vector3 index(double(offset % 100), double(offset / 100 % 76), double(offset / 7600));
    volume.hu.push_back(static_cast<float>(chest_hu(1000 * volume.grid.patient_m(index))));
  }
  return volume;
}

TEST(LungMask, FindsBothLungsWithTheirVesselsAndWithoutTheWindpipe) {
  for (const bool head_first : {false, true}) {
    const Volume volume = chest(head_first);
    const LungMask found = find_lungs(volume);
    EXPECT_EQ(found.lungs, 2U);
    EXPECT_GT(found.airway_ml, 5);
    const auto label_at = [&](const Vector3& at_mm) {
      const Vector3 index = volume.grid.index(at_mm / 1000).array().round();
      return found.map
          .labels[volume.grid.offset(std::size_t(index.x()), std::size_t(index.y()), std::size_t(index.z()))];
    };
    EXPECT_EQ(label_at({-55, 0, 0}), 1);
    EXPECT_EQ(label_at({40, 0, 10}), 1);    // a vessel
    EXPECT_EQ(label_at({0, 0, 20}), 0);     // the windpipe
    EXPECT_EQ(label_at({15, 0, 0}), 0);     // a bronchus
    EXPECT_EQ(label_at({0, 40, 0}), 0);     // tissue
    EXPECT_EQ(label_at({-98, -74, 0}), 0);  // the room
    const double lung_m3 = double(std::ranges::count(found.map.labels, 1)) * 8e-9;
    EXPECT_NEAR(lung_m3, 2 * 4.0 / 3 * 3.14159 * 0.032 * 0.032 * 0.032, 0.1 * lung_m3);
  }
}

TEST(LungMask, RefusesWhatHasNone) {
  Volume volume = chest(false);
  std::ranges::replace(volume.hu, -800.0F, 20.0F);
  const auto refusal = [&]() -> std::string {
    try {
      (void)find_lungs(volume);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal(), HasSubstr("no air within the body"));
  volume.grid.direction << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  EXPECT_THAT(refusal(), HasSubstr("not axial"));
}

/// Twice what both have, of what each has.
double dice(const LabelMap& one, const LabelMap& other) {
  double both = 0, sum = 0;
  for (std::size_t voxel = 0; voxel < one.labels.size(); ++voxel) {
    both += one.labels[voxel] != 0 && other.labels[voxel] != 0 ? 1 : 0;
    sum += (one.labels[voxel] != 0 ? 1 : 0) + (other.labels[voxel] != 0 ? 1 : 0);
  }
  return 2 * both / sum;
}

TEST(LungMask, AgreesWithASegmentationOfARealPatient) {
  KIROKU_NEEDS_SHARED_DATA("sim/lung-ct");
  const test::Unpacked folder("sim/lung-ct/lidc-idri-0001-dicom.tar.xz");
  const Volume volume = read_volume(folder.path(), {}).volume;
  LabelMap segmented =
      resampled(read_label_map(test::shared_data("sim/lung-ct/mask_totalsegmentator.nii.gz")), volume.grid);
  std::size_t trachea = 0, trachea_left = 0;
  const LungMask found = find_lungs(volume);
  for (std::size_t voxel = 0; voxel < segmented.labels.size(); ++voxel) {
    if (segmented.labels[voxel] != 16) continue;
    ++trachea;
    trachea_left += found.map.labels[voxel];
  }
  EXPECT_LT(double(trachea_left), 0.02 * double(trachea));
  for (std::uint16_t& label : segmented.labels) label = label >= 10 && label <= 14 ? 1 : 0;
  const double agreement = dice(found.map, segmented);
  RecordProperty("dice", std::to_string(agreement));
  RecordProperty("airway_ml", std::to_string(found.airway_ml));
  EXPECT_NEAR(found.airway_ml, 20, 10);
  EXPECT_GT(agreement, 0.97);
}

}  // namespace
}  // namespace kiroku::sim

#include "sim/volume/volume.h"

#include <gtest/gtest.h>

#include "tests/support/orientations.h"

namespace kiroku::sim {
namespace {

using test::axis_orientations;

Grid small_grid(const Eigen::Matrix3d& direction) {
  Grid grid;
  grid.size = {5, 4, 3};
  grid.spacing_m = {0.001, 0.002, 0.0025};
  grid.origin_m = {-0.1, 0.2, 0.3};
  grid.direction = direction;
  return grid;
}

template <typename Action>
void for_each_voxel(const Grid& grid, Action action) {
  for (std::size_t k = 0; k < grid.size[2]; ++k) {
    for (std::size_t j = 0; j < grid.size[1]; ++j) {
      for (std::size_t i = 0; i < grid.size[0]; ++i) {
        action(Vector3(double(i), double(j), double(k)), grid.offset(i, j, k));
      }
    }
  }
}

TEST(Volume, SamplesALinearFieldExactly) {
  const auto field = [](const Vector3& at_m) {
    return 40 + 1000 * at_m.x() - 3000 * at_m.y() + 500 * at_m.z();
  };
  for (const Eigen::Matrix3d& direction : axis_orientations()) {
    Volume volume{small_grid(direction), std::vector<float>(60)};
    for_each_voxel(volume.grid, [&](const Vector3& index, std::size_t offset) {
      volume.hu[offset] = static_cast<float>(field(volume.grid.patient_m(index)));
    });
    for (const Vector3& index :
         {Vector3(0, 0, 0), Vector3(4, 3, 2), Vector3(1.3, 2.7, 0.2), Vector3(3.9, 0, 1.5)}) {
      const Vector3 at = volume.grid.patient_m(index);
      EXPECT_NEAR(sample_hu(volume, at), field(at), 1e-4);
    }
    EXPECT_EQ(sample_hu(volume, volume.grid.patient_m({-0.01, 0, 0})), kAirHu);
    EXPECT_EQ(sample_hu(volume, volume.grid.patient_m({0, 3.01, 0})), kAirHu);
  }
}

TEST(Volume, SamplesASingleSlice) {
  Volume volume{small_grid(Eigen::Matrix3d::Identity()), std::vector<float>(20, 7)};
  volume.grid.size[2] = 1;
  EXPECT_EQ(sample_hu(volume, volume.grid.patient_m({1.5, 1.5, 0})), 7);
}

TEST(LabelMap, IsPlacedByWhereItsVoxelsAreInThePatient) {
  // Labels by place, on a grid of any orientation, arrive where they belong on a finer grid.
  const auto label_at = [](const Vector3& at_m) {
    return static_cast<std::uint16_t>(1 + (at_m.x() > 0) + 2 * (at_m.y() > 0) + 4 * (at_m.z() > 0));
  };
  Grid fine;
  fine.size = {8, 8, 8};
  fine.spacing_m = Vector3::Constant(0.001);
  fine.origin_m = Vector3::Constant(-0.0035);
  for (const Eigen::Matrix3d& direction : axis_orientations()) {
    LabelMap map;
    map.grid.size = {4, 4, 4};
    map.grid.spacing_m = Vector3::Constant(0.002);
    map.grid.direction = direction;
    map.grid.origin_m = -direction * Vector3::Constant(0.003);
    map.labels.resize(64);
    for_each_voxel(map.grid, [&](const Vector3& index, std::size_t offset) {
      map.labels[offset] = label_at(map.grid.patient_m(index));
    });
    const LabelMap result = resampled(map, fine);
    for_each_voxel(fine, [&](const Vector3& index, std::size_t offset) {
      EXPECT_EQ(result.labels[offset], label_at(fine.patient_m(index)));
    });
  }
}

TEST(LabelMap, IsZeroBesideItsVoxels) {
  LabelMap map;
  map.grid.size = {1, 1, 1};
  map.grid.spacing_m = Vector3::Constant(0.002);
  map.labels = {9};
  Grid wide;
  wide.size = {5, 1, 1};
  wide.spacing_m = Vector3::Constant(0.0009);
  wide.origin_m = {-0.0018, 0, 0};
  EXPECT_EQ(resampled(map, wide).labels, (std::vector<std::uint16_t>{0, 9, 9, 9, 0}));
}

}  // namespace
}  // namespace kiroku::sim

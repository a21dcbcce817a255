// Where the voxels of a volume are in the patient. Plain data; functions are pure and thread-safe.
//
// Patient coordinates are those of DICOM (PS3.3 C.7.6.2): x to the patient's left, y to the back, z to the
// head ("LPS"), here in metres. Readers turn what a file says (RAS of NIfTI, rows that run the other way,
// feet first) into this once.
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include <Eigen/Core>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

struct Grid {
  std::array<std::size_t, 3> size{};    // voxels along i (a row), j (down the rows), k (through the slices)
  Vector3 spacing_m = Vector3::Ones();  // between centres of voxels, positive
  Vector3 origin_m = Vector3::Zero();   // the centre of voxel (0, 0, 0)
  Eigen::Matrix3d direction = Eigen::Matrix3d::Identity();  // orthonormal; columns: where i, j and k run to

  [[nodiscard]] std::size_t voxels() const { return size[0] * size[1] * size[2]; }
  /// Of the voxel in an array with i fastest.
  [[nodiscard]] std::size_t offset(std::size_t i, std::size_t j, std::size_t k) const {
    return i + size[0] * (j + size[1] * k);
  }
  /// origin + direction (index * spacing); whole numbers are centres of voxels.
  [[nodiscard]] Vector3 patient_m(const Vector3& index) const;
  [[nodiscard]] Vector3 index(const Vector3& patient_m) const;
};

/// Where the axes run to, by the nearest of the patient's: "LPS" for i to the left, j to the back, k to the
/// head; "RAI" for the opposite of each.
std::string orientation_code(const Grid& grid);
/// The largest angle between an axis of the grid and the patient's axis nearest to it.
double oblique_angle_rad(const Grid& grid);

/// Whether voxels of both are at the same places, to a hundredth of their spacing.
bool same_places(const Grid& a, const Grid& b);

/// kiroku::Error beginning with `what` where a size is zero, the spacing is not positive, anything is not
/// finite or the directions are not at right angles. Makes the directions orthonormal to the last bit that
/// matters, as six decimals in a header do not.
void make_sound(Grid& grid, const std::string& what);

}  // namespace kiroku::sim

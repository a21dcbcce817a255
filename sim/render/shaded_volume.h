// A CT as the texture that pictures are drawn from: HU and their gradient, made once. Plain data; functions
// are pure and thread-safe.
//
// Source: section 3 of "Interactive Volume Manipulation for Supporting Preoperative Planning": gradients are
// precomputed, and turned with the deformation when they are used; no voxel is ever computed anew.
#pragma once

#include <cstdint>
#include <span>

#include "sim/volume/volume.h"

namespace kiroku::sim {

/// What gradients are told apart: ± this, in steps of a 32767th.
inline constexpr double kGreatestGradientHuPerMm = 1000;

struct ShadedVolume {
  std::array<std::size_t, 3> size{};
  /// (voxels x 4), i fastest: the gradient along the patient's x, y and z, 32768 for none and 32767 more for
  /// kGreatestGradientHuPerMm; HU from 0 for -1024 to 65535 for 3071.
  std::vector<std::uint16_t> texels;
  Eigen::Matrix<double, 3, 4> texture_from_patient_m;  // 0 to 1 from border to border of the texels
  double spacing_m = 0;                                // the least
  Extent box_m;                                        // of the whole CT, along the patient's axes
  /// Least and greatest HU of every block of kBlock^3 voxels and the voxels beside it; i fastest.
  static constexpr std::size_t kBlock = 4;
  std::array<std::size_t, 3> blocks{};
  std::vector<std::array<float, 2>> block_hu;

  [[nodiscard]] Vector3 texture_of(const Vector3& patient_m) const {
    return texture_from_patient_m.leftCols<3>() * patient_m + texture_from_patient_m.col(3);
  }
};

struct ShadingOptions {
  /// Gradients are those of the CT after a Gaussian of this standard deviation: noise has steep ones.
  double gradient_smoothing_m = 1e-3;
  /// The HU themselves, likewise; 0 leaves them as they are.
  double smoothing_m = 0;
};

/// Of the part of the CT that holds the box, in a layer of texels of air. kiroku::Error where none does.
ShadedVolume shade(const Volume& volume, const Extent& box, const ShadingOptions& options = {});

/// All HU that can be sampled within a tetrahedron are within this range; air where it leaves the CT.
std::array<float, 2> hu_range(const ShadedVolume& volume, std::span<const Vector3, 4> corners_m);

}  // namespace kiroku::sim

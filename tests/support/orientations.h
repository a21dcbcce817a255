// All ways in which the axes of a volume can lie along the patient's.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include <Eigen/Core>

namespace kiroku::test {

/// 48 matrices with one entry of 1 or -1 in each row and column, mirrored ones too.
inline std::vector<Eigen::Matrix3d> axis_orientations() {
  std::vector<Eigen::Matrix3d> all;
  std::array<Eigen::Index, 3> axes{0, 1, 2};
  do {
    for (unsigned signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d direction = Eigen::Matrix3d::Zero();
      for (Eigen::Index column = 0; column < 3; ++column) {
        direction(axes[static_cast<std::size_t>(column)], column) = (signs >> column & 1U) != 0 ? -1 : 1;
      }
      all.push_back(direction);
    }
  } while (std::ranges::next_permutation(axes).found);
  return all;
}

}  // namespace kiroku::test

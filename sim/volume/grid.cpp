#include "sim/volume/grid.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::sim {
namespace {

/// Two decimals of direction cosines, as careless writers leave them, are half a degree.
constexpr double kMostSkew = 0.02;
/// So that offsets and byte counts stay far from overflow, and a forged header does not ask for all memory.
constexpr std::size_t kMostVoxels = std::size_t{1} << 30U;

/// Row of the entry of greatest magnitude.
Eigen::Index nearest_axis(const Vector3& direction) {
  Eigen::Index axis = 0;
  direction.cwiseAbs().maxCoeff(&axis);
  return axis;
}

}  // namespace

Vector3 Grid::patient_m(const Vector3& index) const {
  return origin_m + direction * index.cwiseProduct(spacing_m);
}

Vector3 Grid::index(const Vector3& patient_m) const {
  return (direction.transpose() * (patient_m - origin_m)).cwiseQuotient(spacing_m);
}

std::string orientation_code(const Grid& grid) {
  constexpr std::array<std::array<char, 2>, 3> kLetters{{{'L', 'R'}, {'P', 'A'}, {'S', 'I'}}};
  std::string code;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const Vector3 to = grid.direction.col(axis);
    const Eigen::Index nearest = nearest_axis(to);
    code += kLetters[static_cast<std::size_t>(nearest)][to[nearest] < 0 ? 1 : 0];
  }
  return code;
}

double oblique_angle_rad(const Grid& grid) {
  double least_cosine = 1;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    least_cosine = std::min(least_cosine, grid.direction.col(axis).cwiseAbs().maxCoeff());
  }
  return std::acos(least_cosine);
}

bool same_places(const Grid& a, const Grid& b) {
  if (a.size != b.size) return false;
  const double tolerance_m = 0.01 * a.spacing_m.minCoeff();
  for (unsigned corner = 0; corner < 8; ++corner) {
    Vector3 index;
    for (unsigned axis = 0; axis < 3; ++axis) {
      index[axis] = (corner >> axis & 1U) != 0 ? static_cast<double>(a.size[axis]) - 1 : 0;
    }
    if (!((a.patient_m(index) - b.patient_m(index)).norm() <= tolerance_m)) return false;
  }
  return true;
}

void make_sound(Grid& grid, const std::string& what) {
  std::size_t voxels = 1;
  for (const std::size_t size : grid.size) {
    if (size == 0) throw Error(what + ": it has no voxels along one of its axes");
    if (size > kMostVoxels / voxels) {
      throw Error(what + ": it says that it has " + std::to_string(grid.size[0]) + " x " +
                  std::to_string(grid.size[1]) + " x " + std::to_string(grid.size[2]) +
                  " voxels, more than are handled (" + std::to_string(kMostVoxels) + ")");
    }
    voxels *= size;
  }
  if (!grid.spacing_m.allFinite() || !(grid.spacing_m.minCoeff() > 0)) {
    throw Error(what + ": the distances between its voxels are " + number_text(1000 * grid.spacing_m.x()) +
                " x " + number_text(1000 * grid.spacing_m.y()) + " x " +
                number_text(1000 * grid.spacing_m.z()) + " mm; each must be positive");
  }
  if (!grid.origin_m.allFinite()) throw Error(what + ": the place of its first voxel is not finite");
  if (!grid.direction.allFinite() ||
      (grid.direction.transpose() * grid.direction - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() >
          kMostSkew) {
    throw Error(what +
                ": the directions of its axes are not unit vectors at right angles; resample it with "
                "the tool that wrote it");
  }
  // The nearest orthonormal matrix, unless it is one already: identity stays identity.
  if ((grid.direction.transpose() * grid.direction - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() >
      1e-15) {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(grid.direction, Eigen::ComputeFullU | Eigen::ComputeFullV);
    grid.direction = svd.matrixU() * svd.matrixV().transpose();
  }
}

}  // namespace kiroku::sim

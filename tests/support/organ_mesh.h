// A body shaped like an organ, of uneven tetrahedra: rounded, bent, its inner nodes moved about; and blade
// paths through bodies. Fixed seeds.
#pragma once

#include <random>

#include <Eigen/Geometry>

#include "sim/cutting/blade_path.h"
#include "tests/support/tet_grid.h"

namespace kiroku::test {

/// 0 to 1, the same on every platform.
inline double uniform(std::mt19937& random) { return static_cast<double>(random()) / 4294967296.0; }

/// About `size_m` long, wide and high around the origin, from a grid of as many cells.
inline sim::TetMesh organ_mesh(const std::array<std::uint32_t, 3>& cells, const sim::Vector3& size_m) {
  sim::TetMesh mesh = tet_grid(cells, {2, 2, 2});
  std::mt19937 random(5);
  for (sim::Vector3& node : mesh.nodes) {
    sim::Vector3 at = node - sim::Vector3::Ones();
    if (at.cwiseAbs().maxCoeff() < 0.999) {
      for (Eigen::Index i = 0; i < 3; ++i)
        at[i] += 0.6 / cells[static_cast<std::size_t>(i)] * (uniform(random) - 0.5);
    }
    // The farther out, the more the cube's shells are pulled in towards spheres.
    const double shell = at.cwiseAbs().maxCoeff();
    if (shell > 0) at *= 1 - 0.5 * shell + 0.65 * shell * shell / at.norm();
    at.z() += 0.2 * at.x() * at.x();
    node = at.cwiseProduct(size_m) / 2;
  }
  return mesh;
}

/// Two to seven sweeps of a blade of its own length, that turns a little as it goes; some begin and end
/// outside, some inside, few go right through.
inline std::vector<sim::BladePose> random_blade_path(const sim::Extent& body, std::mt19937& random) {
  const sim::Vector3 size_m = body.greatest - body.least;
  const auto vector = [&] {
    const double x = uniform(random), y = uniform(random), z = uniform(random);
    return sim::Vector3(x, y, z);
  };
  const auto point = [&] {
    return sim::Vector3(body.least - 0.1 * size_m + 1.2 * size_m.cwiseProduct(vector()));
  };
  const sim::Vector3 from = point(), to = point();
  const sim::Vector3 half = 0.5 * sim::Vector3::Ones();
  sim::Vector3 along = (vector() - half).normalized();
  const double length_m = body.longest_side_m() * (0.2 + 0.5 * uniform(random));
  const auto steps = static_cast<int>(2 + random() % 6);
  std::vector<sim::BladePose> path;
  for (int step = 0; step <= steps; ++step) {
    const sim::Vector3 at = from + (to - from) * step / steps;
    along = (along + 0.15 * (vector() - half)).normalized();
    path.push_back({at - along * length_m / 2, at + along * length_m / 2});
  }
  return path;
}

}  // namespace kiroku::test

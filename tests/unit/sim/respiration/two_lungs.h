// A pair of lungs of a made-up shape, and a deep breath of theirs that no model of Kiroku makes: it is a
// formula. What a test fits is meshed coarsely, its truth finely, so that neither knows the other's elements.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "sim/respiration/breathing_model.h"
#include "sim/respiration/landmarks.h"
#include "sim/respiration/mesh_point.h"
#include "tests/support/tet_grid.h"

namespace kiroku::test {

/// Cells along x, y and z of each lung's mesh.
struct LungCells {
  std::array<std::uint32_t, 3> each{};
};
inline constexpr LungCells kCoarse{{5, 7, 10}}, kFine{{9, 12, 16}};

/// Of a cube from -1 to 1: a lung's shape, 1 high above its middle and half of it below, where it is flat.
inline sim::Vector3 lung_shape(const sim::Vector3& p) {
  // Half-way from the cube's layers to a ball's.
  const sim::Vector3 ball =
      p.norm() > 0 ? sim::Vector3(p * (1 + p.lpNorm<Eigen::Infinity>() / p.norm()) / 2) : p;
  const double narrower = 1 - 0.35 * std::max(0.0, ball.z());
  return {ball.x() * narrower, ball.y() * narrower, ball.z() > 0 ? ball.z() : 0.45 * ball.z()};
}

/// The right lung is wider and lower than the left, as its diaphragm is higher. Regions are 1.
inline sim::TetMesh two_lungs(const LungCells& cells) {
  sim::TetMesh both;
  struct Side {
    sim::Vector3 centre_m, half_m;
  };
  for (const Side& side :
       {Side{{-0.085, 0, 0.02}, {0.062, 0.09, 0.13}}, Side{{0.08, 0.005, 0}, {0.05, 0.085, 0.15}}}) {
    const sim::TetMesh cube = tet_grid(cells.each, {2, 2, 2});
    const auto first = static_cast<std::uint32_t>(both.nodes.size());
    for (const sim::Vector3& node : cube.nodes) {
      both.nodes.emplace_back(side.centre_m +
                              lung_shape(node - sim::Vector3::Ones()).cwiseProduct(side.half_m));
    }
    for (sim::Tetrahedron corners : cube.tetrahedra) {
      for (std::uint32_t& corner : corners) corner += first;
      both.tetrahedra.push_back(corners);
      both.regions.push_back(1);
    }
  }
  return both;
}

/// Down and out by up to 50 mm, most near the diaphragm; 1.7 times the volume. In another patient position.
inline sim::Vector3 breathed_in(const sim::Vector3& p) {
  const double top = 0.16, deep = std::max(0.0, top - p.z());
  const double sideways = 1 + 0.25 * deep / 0.2;
  sim::Vector3 q(p.x() * (1 + 0.06 * deep / 0.2), (p.y() - 0.05) * sideways + 0.05,
                 top - deep * (1.12 + 0.18 * deep / 0.2 + 0.1 * std::sin(20 * p.x())));
  return q + sim::Vector3(0.004, -0.006, 0.01);
}

inline sim::BreathingModel two_lungs_model() {
  sim::BreathingModel model;
  model.mesh = two_lungs(kCoarse);
  model.materials = {{1, sim::kLungTissue}};
  model.groups = sim::find_boundary_groups(model.mesh, sim::surface_of(model.mesh), nullptr, {});
  return model;
}

/// Of two_lungs(kFine), moved by `motion`, on voxels of `spacing_m`.
template <typename Motion>
sim::LabelMap mask_of_two_lungs(Motion motion,
                                const sim::Vector3& spacing_m = sim::Vector3::Constant(0.0025)) {
  const sim::TetMesh fine = two_lungs(kFine);
  std::vector<sim::Vector3> places_m;
  sim::Vector3 least = sim::Vector3::Constant(1e9), greatest = -least;
  for (const sim::Vector3& node : fine.nodes) {
    places_m.emplace_back(motion(node));
    least = least.cwiseMin(places_m.back());
    greatest = greatest.cwiseMax(places_m.back());
  }
  sim::LabelMap mask;
  mask.grid.spacing_m = spacing_m;
  mask.grid.origin_m = least - 2.5 * spacing_m;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    mask.grid.size[axis] = static_cast<std::size_t>((greatest[a] - least[a]) / spacing_m[a]) + 6;
  }
  std::vector<std::uint8_t> marked(mask.grid.voxels());
  sim::mark_voxels(places_m, fine.tetrahedra, mask.grid, marked);
  mask.labels.assign(marked.begin(), marked.end());
  return mask;
}

/// Inner nodes of the fine mesh and where the breath takes them.
inline sim::LandmarkPairs breath_landmarks() {
  const sim::TetMesh fine = two_lungs(kFine);
  const sim::LungSurface surface = sim::surface_of(fine);
  sim::LandmarkPairs pairs;
  for (std::size_t node = 0; node < fine.nodes.size(); ++node) {
    if (surface.row_of[node] >= 0) continue;
    pairs.fixed_m.push_back(fine.nodes[node]);
    pairs.moving_m.push_back(breathed_in(fine.nodes[node]));
  }
  return pairs;
}

}  // namespace kiroku::test

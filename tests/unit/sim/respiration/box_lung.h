// A right lung in the shape of a box with a tumour in it, as a model whose motion is known.
#pragma once

#include "sim/respiration/breathing_model.h"
#include "tests/support/tet_grid.h"

namespace kiroku::test {

inline const sim::Vector3 kBoxTumourM(-0.07, 0.05, 0.09);

/// 10 x 15 x 25 cm; region 2 is the tumour. `cells`: along each side.
inline sim::BreathingModel box_lung_model(const std::array<std::uint32_t, 3>& cells = {4, 6, 10}) {
  sim::BreathingModel model;
  model.mesh = tet_grid(cells, {0.1, 0.15, 0.25});
  for (sim::Vector3& node : model.mesh.nodes) node.x() -= 0.12;
  for (std::size_t t = 0; t < model.mesh.tetrahedra.size(); ++t) {
    sim::Vector3 centre = sim::Vector3::Zero();
    for (const std::uint32_t node : model.mesh.tetrahedra[t]) centre += model.mesh.nodes[node] / 4;
    model.mesh.regions[t] = (centre - kBoxTumourM).norm() < 0.03 ? 2 : 1;
  }
  model.materials = {{1, sim::kLungTissue}, {2, sim::kTumourTissue}};
  model.tumour = sim::tumour_of_region(model.mesh, 2);
  sim::GroupRules rules;
  rules.side = sim::LungSide::kRight;
  model.groups = sim::find_boundary_groups(model.mesh, sim::surface_of(model.mesh), nullptr, rules);
  return model;
}

}  // namespace kiroku::test

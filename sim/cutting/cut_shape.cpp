#include "sim/cutting/cut_shape.h"

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "sim/fem/rigid_motion.h"

namespace kiroku::sim {

CutShape::CutShape(const TetMesh& mesh, Constraints constraints)
    : constraints_(std::move(constraints)), geometry_(mesh), adrift_(mesh.tetrahedra.size()) {}

CutShape::Step CutShape::cut(const SweepSurface& sweep) {
  Step step;
  step.cut = geometry_.cut(sweep);
  if (step.changed()) find_adrift(step);
  return step;
}

TetMesh CutShape::bearing() const {
  const TetMesh& mesh = geometry_.mesh();
  TetMesh bearing{mesh.nodes, {}, {}};
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    if (!bears(t)) continue;
    bearing.tetrahedra.push_back(mesh.tetrahedra[t]);
    bearing.regions.push_back(mesh.regions[t]);
  }
  return bearing;
}

void CutShape::find_adrift(Step& step) {
  const TetMesh& mesh = geometry_.mesh();
  const Parts parts = geometry_.parts();
  std::vector<std::vector<std::uint32_t>> tetrahedra(parts.count);
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    if (parts.of_tetrahedron[t] != VertexPreservingCut::kGone)
      tetrahedra[parts.of_tetrahedron[t]].push_back(t);
  }
  std::vector<std::uint32_t> nodes;
  std::size_t held = 0;
  for (const std::vector<std::uint32_t>& part : tetrahedra) {
    if (adrift_[part.front()] != 0) continue;  // what has fallen off stays so, cut again or not
    nodes.clear();
    for (const std::uint32_t t : part) {
      for (const std::uint32_t node : mesh.tetrahedra[t]) {
        const std::size_t number = 3 * std::size_t{node};
        if (constraints_.prescribed(number) || constraints_.prescribed(number + 1) ||
            constraints_.prescribed(number + 2))
          nodes.push_back(node);
      }
    }
    std::ranges::sort(nodes);
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    if (!nodes.empty() && hold_still(mesh, nodes, constraints_)) {
      ++held;
      continue;
    }
    for (const std::uint32_t t : part) adrift_[t] = 1;
    step.adrift.insert(step.adrift.end(), part.begin(), part.end());
    step.fallen.push_back("a part of " + std::to_string(part.size()) +
                          (part.size() == 1 ? " tetrahedron" : " tetrahedra") + " with node " +
                          std::to_string(mesh.tetrahedra[part.front()][0]) +
                          " hangs on nothing that is fixed any longer: it is held where it was");
  }
  if (held == 0) throw Error("the cut leaves nothing that is held: fix a part of the body it does not part");
}

}  // namespace kiroku::sim

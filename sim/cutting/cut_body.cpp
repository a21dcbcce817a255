#include "sim/cutting/cut_body.h"

#include <algorithm>

#include "base/error.h"
#include "sim/fem/rigid_motion.h"

namespace kiroku::sim {

CutBody::CutBody(const TetMesh& mesh, const Materials& materials, const Constraints& constraints)
    : constraints_(constraints),
      shape_(mesh),
      body_(mesh, materials, constraints),
      adrift_(mesh.tetrahedra.size()) {
  body_.apply({}, {});  // so that the first step is as quick as the others
}

CutBody::Step CutBody::cut(const SweepSurface& sweep) {
  Step step;
  step.cut = shape_.cut(sweep);
  if (step.cut.change.removed.empty() && step.cut.change.moved.empty()) return step;
  const std::vector<std::uint32_t> adrift = find_adrift(step.fallen);
  body_.apply(step.cut.change, adrift);
  return step;
}

/// Tetrahedra that hang on nothing since this step.
std::vector<std::uint32_t> CutBody::find_adrift(std::vector<std::string>& sentences) {
  const TetMesh& mesh = shape_.mesh();
  const Parts parts = shape_.parts();
  std::vector<std::vector<std::uint32_t>> tetrahedra(parts.count);
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    if (parts.of_tetrahedron[t] != VertexPreservingCut::kGone)
      tetrahedra[parts.of_tetrahedron[t]].push_back(t);
  }
  std::vector<std::uint32_t> adrift, nodes;
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
    adrift.insert(adrift.end(), part.begin(), part.end());
    sentences.push_back("a part of " + std::to_string(part.size()) +
                        (part.size() == 1 ? " tetrahedron" : " tetrahedra") + " with node " +
                        std::to_string(mesh.tetrahedra[part.front()][0]) +
                        " hangs on nothing that is fixed any longer: it is held where it was");
  }
  if (held == 0) throw Error("the cut leaves nothing that is held: fix a part of the body it does not part");
  return adrift;
}

}  // namespace kiroku::sim

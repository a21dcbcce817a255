#include "sim/meshing/organ_mesher.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/meshing/tet_mesher.h"

namespace kiroku::sim {
namespace {

/// Refinement runs of the search; each takes a fraction of what removing slivers takes.
constexpr int kMostTrials = 8;
/// The search is content earlier than kNodeTolerance: removing slivers still moves a few nodes.
constexpr double kSearchTolerance = 0.08;
/// Attempts with slightly other cells where slivers remain.
constexpr int kMostAttempts = 4;
constexpr double kOtherCells = 0.985;

double labelled_volume_m3(const LabelMap& map) {
  const auto labelled =
      static_cast<double>(map.labels.size()) - static_cast<double>(std::ranges::count(map.labels, 0));
  return labelled * map.grid.spacing_m.prod();
}

/// A cell size and the nodes it gave.
struct Trial {
  double cell_m = 0;
  std::size_t nodes = 0;
};

/// The size for `wanted` nodes by the power law through two trials, n ~ cell^-p; p is between that of a sheet
/// and a little above that of a block, and that of a block after one trial.
double next_cell_m(const std::vector<Trial>& trials, double wanted) {
  const Trial& last = trials.back();
  double power = 2.6;
  if (trials.size() > 1) {
    const Trial& before = trials[trials.size() - 2];
    const double ratio = std::log(before.cell_m / last.cell_m);
    if (std::abs(ratio) > 1e-6) {
      power = std::log(static_cast<double>(last.nodes) / static_cast<double>(before.nodes)) / ratio;
    }
    power = std::clamp(power, 1.5, 3.5);
  }
  return last.cell_m * std::pow(static_cast<double>(last.nodes) / wanted, 1 / power);
}

bool within(std::size_t nodes, std::size_t wanted, double tolerance) {
  return std::abs(static_cast<double>(nodes) / static_cast<double>(wanted) - 1) <= tolerance;
}

class Search {
 public:
  Search(const LabelMap& body, const MeshRequest& request,
         const std::function<void(const std::string&)>& step)
      : mesher_(body), request_(request), step_(step) {
    // Lungs, livers and balls took cells of 1.3 to 1.6 times this root.
    first_cell_m_ = 1.4 * std::cbrt(labelled_volume_m3(body) / static_cast<double>(request.nodes));
  }

  /// Finds cells for the nodes that are wanted; the nearest found where they are not met.
  Trial find() {
    std::vector<Trial> trials;
    double cell_m = first_cell_m_;
    Trial best;
    for (int count = 0; count < kMostTrials; ++count) {
      trials.push_back({cell_m, refined(cell_m)});
      const auto distance = [&](const Trial& trial) {
        return std::abs(std::log(std::max<double>(1, static_cast<double>(trial.nodes)) /
                                 static_cast<double>(request_.nodes)));
      };
      if (count == 0 || distance(trials.back()) < distance(best)) best = trials.back();
      if (within(best.nodes, request_.nodes, kSearchTolerance)) return best;
      cell_m =
          trials.back().nodes == 0 ? cell_m / 2 : next_cell_m(trials, static_cast<double>(request_.nodes));
    }
    return best;
  }

  /// Nodes of the cleaned mesh with such cells.
  std::size_t refined(double cell_m) {
    tell("refining with cells of " + number_text(1000 * cell_m, 3) + " mm");
    TetMesh mesh = mesher_.refine(cell_m, 4 * request_.nodes + 1000);
    refined_cell_m_ = cell_m;
    if (mesh.tetrahedra.empty()) return 0;
    clean(mesh, request_.pieces);
    return mesh.nodes.size();
  }

  OrganMesh optimised(double cell_m) {
    if (cell_m != refined_cell_m_) refined(cell_m);
    tell("removing slivers");
    OrganMesh result;
    result.mesh = mesher_.optimise(kSliverBoundDeg);
    refined_cell_m_ = 0;
    if (result.mesh.tetrahedra.empty()) throw Error("cannot make a mesh: no tetrahedron fits into the body");
    result.cell_m = cell_m;
    result.cleaned = clean(result.mesh, request_.pieces);
    result.quality = measure_quality(result.mesh);
    return result;
  }

 private:
  void tell(const std::string& what) const {
    if (step_) step_(what);
  }

  TetMesher mesher_;
  const MeshRequest& request_;
  const std::function<void(const std::string&)>& step_;
  double first_cell_m_ = 0, refined_cell_m_ = 0;
};

void add_findings(OrganMesh& result, const MeshRequest& request) {
  if (result.voxels.parts > 0) {
    result.findings.push_back(
        (result.voxels.parts == 1 ? "1 part" : std::to_string(result.voxels.parts) + " parts") +
        " of the body (" + std::to_string(result.voxels.voxels) + " voxels) beside " +
        (request.pieces == 1 ? "the largest" : "the " + std::to_string(request.pieces) + " largest") +
        " left out");
  }
  if (!within(result.mesh.nodes.size(), request.nodes, kNodeTolerance)) {
    result.findings.push_back("the mesh has " + std::to_string(result.mesh.nodes.size()) + " nodes; " +
                              std::to_string(request.nodes) +
                              " could not be met, as the body's shape needs others");
  }
}

}  // namespace

OrganMesh make_organ_mesh(const LabelMap& regions, const MeshRequest& request,
                          const std::function<void(const std::string&)>& step) {
  if (request.nodes < kLeastNodes || request.nodes > kMostMeshNodes) {
    throw UsageError("cannot make a mesh of " + std::to_string(request.nodes) + " vertices: ask for " +
                     std::to_string(kLeastNodes) + " to " + std::to_string(kMostMeshNodes));
  }
  if (request.pieces == 0) throw UsageError("cannot make a mesh of 0 pieces");
  LabelMap body = cropped(regions, 1);
  const RemovedParts removed = keep_largest_parts(body, request.pieces);
  Search search(body, request, step);
  double cell_m = search.find().cell_m;
  OrganMesh result = search.optimised(cell_m);
  for (int attempt = 1; attempt < kMostAttempts && result.quality.least_dihedral_deg < kLeastDihedralDeg;
       ++attempt) {
    cell_m *= kOtherCells;
    result = search.optimised(cell_m);
  }
  if (result.quality.least_dihedral_deg < kLeastDihedralDeg) {
    throw Error("cannot make a mesh of about " + std::to_string(request.nodes) +
                " vertices: " + std::to_string(result.quality.below_8_deg) +
                " tetrahedra stay flatter than " + number_text(kLeastDihedralDeg) + " degrees (least " +
                number_text(result.quality.least_dihedral_deg, 3) + "); ask for another number of vertices");
  }
  result.voxels = removed;
  add_findings(result, request);
  return result;
}

}  // namespace kiroku::sim

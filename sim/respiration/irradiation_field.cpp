#include "sim/respiration/irradiation_field.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/volume/distance_field.h"

namespace kiroku::sim {
namespace {

/// Nodes of the tumour at a phase, by their number in the mesh; others are anywhere.
using Places = std::vector<Vector3>;

/// The volume of all these together, widened by the margin.
double union_m3(const std::vector<Places>& phases, const std::vector<Tetrahedron>& tetrahedra,
                double margin_m, double voxel_m) {
  Vector3 least = phases.front()[tetrahedra.front()[0]], greatest = least;
  for (const Places& places : phases) {
    for (const Tetrahedron& corners : tetrahedra) {
      for (const std::uint32_t node : corners) {
        least = least.cwiseMin(places[node]);
        greatest = greatest.cwiseMax(places[node]);
      }
    }
  }
  Grid grid;
  const double around_m = margin_m + 2 * voxel_m;
  // Half a voxel off, so that borders of the body are not just at centres.
  grid.origin_m = least - Vector3::Constant(around_m + voxel_m / 2);
  grid.spacing_m = Vector3::Constant(voxel_m);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    grid.size[axis] =
        static_cast<std::size_t>(std::ceil((greatest[a] - least[a] + 2 * around_m) / voxel_m)) + 1;
  }
  std::vector<std::uint8_t> marked(grid.voxels());
  for (const Places& places : phases) mark_voxels(places, tetrahedra, grid, marked);
  // From the border of a marked voxel, not from its centre.
  const double reach_m = margin_m + 0.499 * voxel_m;
  std::size_t count = 0;
  for (const float distance_m : distances_m(grid, marked)) {
    if (static_cast<double>(distance_m) <= reach_m) ++count;
  }
  return static_cast<double>(count) * grid.spacing_m.prod();
}

}  // namespace

IrradiationField irradiation_field(const TetMesh& mesh, const Tumour& tumour,
                                   const std::vector<Eigen::VectorXd>& displacements_m, double margin_m) {
  constexpr double kMostMarginM = 0.1;
  if (!(margin_m >= 0 && margin_m <= kMostMarginM))
    throw Error("the margin is " + number_text(1000 * margin_m) + " mm; it must be from 0 to 100 mm");
  IrradiationField field;
  field.margin_m = margin_m;
  field.tumour_m3 = volume_m3(mesh, tumour);
  const double voxel_m = std::clamp(std::cbrt(field.tumour_m3) / 20, 0.0005, 0.002);
  std::vector<Tetrahedron> tetrahedra;
  for (const std::uint32_t t : tumour.tetrahedra) tetrahedra.push_back(mesh.tetrahedra[t]);
  const MeshPoint centre = centre_of(mesh, tumour);
  std::vector<Places> places, centred;
  for (const Eigen::VectorXd& displacement_m : displacements_m) {
    Places at(mesh.nodes.size(), Vector3::Zero()), from_centre = at;
    const Vector3 moved_m = centre.mean(displacement_m);
    for (const std::uint32_t node : centre.nodes) {
      at[node] =
          mesh.nodes[node] + displacement_m.segment<3>(static_cast<Eigen::Index>(3 * std::size_t{node}));
      from_centre[node] = at[node] - moved_m;
    }
    places.push_back(std::move(at));
    centred.push_back(std::move(from_centre));
  }
  field.conventional_m3 = union_m3(places, tetrahedra, margin_m, voxel_m);
  field.tracking_m3 = union_m3(centred, tetrahedra, margin_m, voxel_m);
  return field;
}

}  // namespace kiroku::sim

#include "sim/respiration/tumour.h"

#include <algorithm>
#include <map>

#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::sim {
namespace {

Vector3 centre_of(const TetMesh& mesh, std::size_t tetrahedron) {
  Vector3 sum = Vector3::Zero();
  for (const std::uint32_t node : mesh.tetrahedra[tetrahedron]) sum += mesh.nodes[node];
  return sum / 4;
}

}  // namespace

Tumour tumour_of_region(const TetMesh& mesh, std::int32_t region) {
  Tumour tumour;
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    if (mesh.regions[t] == region) tumour.tetrahedra.push_back(t);
  }
  if (!tumour.tetrahedra.empty()) return tumour;
  std::string known;
  for (const std::int32_t number : regions_of(mesh))
    known += (known.empty() ? "" : ", ") + std::to_string(number);
  throw Error("nothing of the mesh is of region " + std::to_string(region) +
              ", which should be tumour; it has " + known);
}

Tumour tumour_in_ball(const TetMesh& mesh, const Vector3& centre_m, double radius_m) {
  Tumour tumour;
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    if ((centre_of(mesh, t) - centre_m).norm() <= radius_m) tumour.tetrahedra.push_back(t);
  }
  if (tumour.tetrahedra.empty()) {
    throw Error(
        "no element of the mesh has its centre within " + number_text(1000 * radius_m) +
        " mm of where the tumour should be: it is outside the lung, or smaller than the mesh is fine");
  }
  return tumour;
}

double volume_m3(const TetMesh& mesh, const Tumour& tumour) {
  double sum_m3 = 0;
  for (const std::uint32_t t : tumour.tetrahedra) sum_m3 += signed_volume_m3(mesh, t);
  return sum_m3;
}

MeshPoint centre_of(const TetMesh& mesh, const Tumour& tumour) {
  std::map<std::uint32_t, double> weights;
  const double all_m3 = volume_m3(mesh, tumour);
  for (const std::uint32_t t : tumour.tetrahedra) {
    for (const std::uint32_t node : mesh.tetrahedra[t])
      weights[node] += signed_volume_m3(mesh, t) / 4 / all_m3;
  }
  MeshPoint point;
  for (const auto& [node, weight] : weights) {
    point.nodes.push_back(node);
    point.weights.push_back(weight);
  }
  return point;
}

Vector3 excursion_m(const TumourPath& path) {
  Vector3 least = path.rest_m, greatest = path.rest_m;
  if (!path.centres_m.empty()) least = greatest = path.centres_m.front();
  for (const Vector3& centre : path.centres_m) {
    least = least.cwiseMin(centre);
    greatest = greatest.cwiseMax(centre);
  }
  return greatest - least;
}

std::string path_csv(const TumourPath& path, LengthUnit unit) {
  const std::string name = unit == LengthUnit::kMetre ? "m" : "mm";
  const double units = units_per_metre(unit);
  std::string text = "time_s,x_" + name + ",y_" + name + ",z_" + name + ",moved_" + name + "\r\n";
  for (std::size_t i = 0; i < path.times_s.size(); ++i) {
    text += exact_text(path.times_s[i]);
    for (Eigen::Index axis = 0; axis < 3; ++axis) text += "," + exact_text(path.centres_m[i][axis] * units);
    text += "," + exact_text((path.centres_m[i] - path.rest_m).norm() * units) + "\r\n";
  }
  return text;
}

}  // namespace kiroku::sim

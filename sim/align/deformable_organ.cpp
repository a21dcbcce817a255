#include "sim/align/deformable_organ.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

#include "base/error.h"
#include "sim/fem/element.h"

namespace kiroku::sim {
namespace {

Eigen::Matrix3d cross_with(const Vector3& of) {
  Eigen::Matrix3d matrix;
  matrix << 0, -of.z(), of.y(), of.z(), 0, -of.x(), -of.y(), of.x(), 0;
  return matrix;
}

/// (1 - cos t) / t^2, (t - sin t) / t^3, and their derivatives with t, each over t.
struct Warp {
  double first = 0.5, second = 1.0 / 6, first_slope = -1.0 / 12, second_slope = -1.0 / 60;
};
Warp warp_of(double angle) {
  // Below, the difference of nearly equal numbers would be worse than the series without its next term.
  constexpr double kSmall = 1e-2;
  const double t = angle, t2 = t * t;
  if (t < kSmall) return {0.5 - t2 / 24, 1.0 / 6 - t2 / 120, -1.0 / 12 + t2 / 180, -1.0 / 60 + t2 / 1260};
  const double sine = std::sin(t), cosine = std::cos(t);
  return {(1 - cosine) / t2, (t - sine) / (t2 * t), (t * sine - 2 * (1 - cosine)) / (t2 * t2),
          (t * (1 - cosine) - 3 * (t - sine)) / (t2 * t2 * t)};
}

double area_m2(const OrganSurface& surface, const std::array<std::uint32_t, 3>& face) {
  const Vector3& a = surface.nodes[face[0]];
  return (surface.nodes[face[1]] - a).cross(surface.nodes[face[2]] - a).norm() / 2;
}

/// Nodes far from each other, the same for the same surface: each time the one farthest from those chosen.
std::vector<std::uint32_t> spread_nodes(const OrganSurface& surface, const std::vector<std::uint32_t>& among,
                                        std::size_t count) {
  std::vector<double> away_m(among.size(), std::numeric_limits<double>::infinity());
  std::vector<std::uint32_t> chosen;
  std::size_t next = 0;
  for (std::size_t i = 0; i < among.size(); ++i) {
    if ((surface.nodes[among[i]] - surface.middle_m).norm() >
        (surface.nodes[among[next]] - surface.middle_m).norm())
      next = i;
  }
  while (chosen.size() < std::min(count, among.size())) {
    chosen.push_back(among[next]);
    for (std::size_t i = 0; i < among.size(); ++i)
      away_m[i] = std::min(away_m[i], (surface.nodes[among[i]] - surface.nodes[chosen.back()]).norm());
    next = static_cast<std::size_t>(std::ranges::max_element(away_m) - away_m.begin());
  }
  return chosen;
}

/// (|among| x patches): how much of each patch's traction acts at a node, times the node's area, m^2. The
/// patches overlap smoothly, and together they are one everywhere.
Eigen::MatrixXd patch_areas_m2(const OrganSurface& surface, const std::vector<std::uint32_t>& among,
                               const std::vector<std::uint32_t>& centres) {
  std::vector<double> node_area_m2(surface.nodes.size(), 0);
  double whole_m2 = 0;
  for (const auto& face : surface.faces) {
    const double area = area_m2(surface, face);
    whole_m2 += area;
    for (const std::uint32_t node : face) node_area_m2[node] += area / 3;
  }
  const double width_m = 0.6 * std::sqrt(whole_m2 / double(centres.size()));
  Eigen::MatrixXd areas(static_cast<Eigen::Index>(among.size()), static_cast<Eigen::Index>(centres.size()));
  for (std::size_t i = 0; i < among.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    for (std::size_t k = 0; k < centres.size(); ++k) {
      const double away = (surface.nodes[among[i]] - surface.nodes[centres[k]]).norm() / width_m;
      areas(row, static_cast<Eigen::Index>(k)) = std::exp(-away * away / 2);
    }
    const double sum = areas.row(row).sum();
    if (sum > 0) areas.row(row) *= node_area_m2[among[i]] / sum;
  }
  return areas;
}

/// Half the curl of a displacement at the surface's nodes, the mean over the tetrahedra around each by their
/// volume; (3|S|).
class NodeRotations {
 public:
  NodeRotations(const TetMesh& mesh, const OrganSurface& surface) : mesh_(mesh), nodes_(surface.mesh_nodes) {
    elements_.reserve(mesh.tetrahedra.size());
    volume_m3_.setZero(static_cast<Eigen::Index>(mesh.nodes.size()));
    for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
      elements_.push_back(element_of(mesh, t));
      for (const std::uint32_t node : mesh.tetrahedra[t]) volume_m3_[node] += elements_.back().volume_m3;
    }
  }
  [[nodiscard]] Eigen::VectorXd of(const Eigen::VectorXd& displacement_m) const {
    Eigen::Matrix3Xd sum = Eigen::Matrix3Xd::Zero(3, volume_m3_.size());
    for (std::size_t t = 0; t < elements_.size(); ++t) {
      const LinearElement& element = elements_[t];
      Vector3 curl = Vector3::Zero();
      for (std::size_t a = 0; a < 4; ++a) {
        const Vector3 gradient = element.gradients.row(static_cast<Eigen::Index>(a)).transpose();
        curl += gradient.cross(displacement_m.segment<3>(3 * Eigen::Index{mesh_.tetrahedra[t][a]}));
      }
      for (const std::uint32_t node : mesh_.tetrahedra[t]) sum.col(node) += element.volume_m3 / 2 * curl;
    }
    Eigen::VectorXd rotations(3 * static_cast<Eigen::Index>(nodes_.size()));
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      rotations.segment<3>(3 * static_cast<Eigen::Index>(i)) = sum.col(nodes_[i]) / volume_m3_[nodes_[i]];
    return rotations;
  }

 private:
  const TetMesh& mesh_;
  const std::vector<std::uint32_t>& nodes_;
  std::vector<LinearElement> elements_;
  Eigen::VectorXd volume_m3_;
};

}  // namespace

SurfacePlace nearest_place(const OrganSurface& surface, const Vector3& at_m) {
  SurfacePlace nearest;
  double least = std::numeric_limits<double>::infinity();
  for (std::uint32_t face = 0; face < surface.faces.size(); ++face) {
    const auto& [i, j, k] = surface.faces[face];
    const Vector3 &a = surface.nodes[i], ab = surface.nodes[j] - a, ac = surface.nodes[k] - a;
    const Vector3 normal = ab.cross(ac);
    const double square = normal.squaredNorm();
    if (!(square > 0)) continue;
    Vector3 weights;
    weights.y() = (at_m - a).cross(ac).dot(normal) / square;
    weights.z() = ab.cross(at_m - a).dot(normal) / square;
    weights.x() = 1 - weights.y() - weights.z();
    // What lies beside the face is brought onto it; near enough, as its neighbour will be nearer.
    weights = weights.cwiseMax(0);
    weights /= weights.sum();
    const double away = (a + weights.y() * ab + weights.z() * ac - at_m).squaredNorm();
    if (away < least) {
      least = away;
      nearest = {face, weights};
    }
  }
  return nearest;
}

Vector3 place_m(const OrganSurface& surface, const SurfacePlace& place) {
  const auto& [i, j, k] = surface.faces[place.face];
  return place.weights.x() * surface.nodes[i] + place.weights.y() * surface.nodes[j] +
         place.weights.z() * surface.nodes[k];
}

DeformableOrgan::DeformableOrgan(const ElasticBody& body, const DeformableOrganOptions& options)
    : surface_(organ_surface(body.mesh())) {
  if (options.patches == 0 || !(options.expected_m > 0))
    throw UsageError("a deformation is sought with at least one patch and an expected size above zero");
  std::vector<std::uint32_t> free;
  for (std::uint32_t i = 0; i < surface_.nodes.size(); ++i) {
    if (body.free_components(surface_.mesh_nodes[i]) > 0) free.push_back(i);
  }
  if (free.empty())
    throw UsageError("the whole surface of the organ is held, so no deformation can be looked for");
  const std::vector<std::uint32_t> centres = spread_nodes(surface_, free, options.patches);
  const Eigen::MatrixXd areas_m2 = patch_areas_m2(surface_, free, centres);
  const auto rows = 3 * static_cast<Eigen::Index>(surface_.nodes.size());
  const Eigen::Index columns = 3 * areas_m2.cols();
  response_m_.resize(rows, columns);
  rotation_.resize(rows, columns);
  const NodeRotations rotations(body.mesh(), surface_);
  const Eigen::VectorXd held = Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(body.mesh().nodes.size()));
  for (Eigen::Index column = 0; column < columns; ++column) {
    Eigen::VectorXd force_n = held;
    for (std::size_t i = 0; i < free.size(); ++i)
      force_n[3 * Eigen::Index{surface_.mesh_nodes[free[i]]} + column % 3] =
          areas_m2(static_cast<Eigen::Index>(i), column / 3);
    const Eigen::VectorXd displacement_m = body.solve(force_n, held).displacement_m;
    for (std::size_t i = 0; i < surface_.nodes.size(); ++i)
      response_m_.col(column).segment<3>(3 * static_cast<Eigen::Index>(i)) =
          displacement_m.segment<3>(3 * Eigen::Index{surface_.mesh_nodes[i]});
    rotation_.col(column) = rotations.of(displacement_m);
  }
  // Of independent coefficients of variance 1, the mean squared displacement is the sum of squares over |S|.
  const double size_m = std::sqrt(response_m_.squaredNorm() / double(surface_.nodes.size()));
  if (!(size_m > 0) || !std::isfinite(size_m))
    throw UsageError("no force on the organ's surface displaces it, so no deformation can be looked for");
  response_m_ *= options.expected_m / size_m;
  rotation_ *= options.expected_m / size_m;
}

OrganShape DeformableOrgan::shape(const Eigen::VectorXd& coefficients) const {
  OrganShape made;
  made.surface = surface_;
  const Eigen::VectorXd responses = response_m_ * coefficients, rotations = rotation_ * coefficients;
  for (std::size_t i = 0; i < surface_.nodes.size(); ++i) {
    const auto row = 3 * static_cast<Eigen::Index>(i);
    const Vector3 response = responses.segment<3>(row), rotation = rotations.segment<3>(row);
    const Warp warp = warp_of(rotation.norm());
    const Vector3 turned = rotation.cross(response);
    made.response_m.push_back(response);
    made.rotation.push_back(rotation);
    made.displacement_m.emplace_back(response + warp.first * turned + warp.second * rotation.cross(turned));
    made.surface.nodes[i] += made.displacement_m.back();
  }
  return made;
}

Eigen::Matrix3Xd DeformableOrgan::derivative(const OrganShape& shape, std::uint32_t node) const {
  const auto row = 3 * Eigen::Index{node};
  const Vector3 &v = shape.response_m[node], &w = shape.rotation[node];
  const Warp warp = warp_of(w.norm());
  const Vector3 turned = w.cross(v), twice = w.cross(turned);
  const Eigen::Matrix3d cross = cross_with(w);
  const Eigen::Matrix3d of_response =
      Eigen::Matrix3d::Identity() + warp.first * cross + warp.second * cross * cross;
  const Eigen::Matrix3d of_rotation = warp.first_slope * turned * w.transpose() - warp.first * cross_with(v) +
                                      warp.second_slope * twice * w.transpose() -
                                      warp.second * (cross_with(turned) + cross * cross_with(v));
  return of_response * response_m_.middleRows<3>(row) + of_rotation * rotation_.middleRows<3>(row);
}

}  // namespace kiroku::sim

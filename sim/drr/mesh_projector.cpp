#include "sim/drr/mesh_projector.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"

namespace kiroku::sim {
namespace {

/// No node of a patient is farther from the origin.
constexpr double kFarthestM = 100;
/// Tissue that is pressed together further than this is no tissue any more, and numbers would lose all
/// meaning.
constexpr double kDensest = 1e4;

/// Bits of three numbers of ten bits each, in turn: near in space, near in order.
std::uint32_t interleaved(const Vector3& place, const Vector3& size) {
  std::uint32_t code = 0;
  for (std::uint32_t bit = 0; bit < 10; ++bit) {
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const auto cell =
          static_cast<std::uint32_t>(std::clamp(place[axis] / std::max(size[axis], 1.0), 0.0, 1.0) * 1023.0);
      code |= (cell >> bit & 1U) << (3 * bit + axis);
    }
  }
  return code;
}

void refuse_outside(const TetMesh& mesh, const std::vector<Vector3>& elements, const Grid& grid) {
  const std::vector<bool> used = nodes_in_use(mesh);
  std::size_t count = 0, farthest = 0;
  double farthest_voxels = 0;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (!used[node]) continue;
    double outside = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double at = elements[node][static_cast<Eigen::Index>(axis)];
      // The outermost faces of voxels are at 0.5 and size + 0.5.
      outside = std::max({outside, 0.5 - at, at - (double(grid.size[axis]) + 0.5)});
    }
    // A mesher smooths over corners of voxels.
    if (outside <= 1) continue;
    ++count;
    if (outside > farthest_voxels) {
      farthest_voxels = outside;
      farthest = node;
    }
  }
  if (count == 0) return;
  const Vector3 at_mm = 1000 * mesh.nodes[farthest];
  throw Error("the mesh lies outside the volume: " + std::to_string(count) + " of its nodes do, node " +
              std::to_string(farthest) + " at (" + number_text(at_mm.x(), 4) + ", " +
              number_text(at_mm.y(), 4) + ", " + number_text(at_mm.z(), 4) + ") mm by " +
              number_text(farthest_voxels, 3) +
              " voxels; give the volume that it was made from, and the mesh's unit");
}

}  // namespace

MeshProjector::MeshProjector(const CtProjector& ct, TetMesh mesh) : ct_(ct), mesh_(std::move(mesh)) {
  const Grid& grid = ct_.grid();
  elements_.reserve(mesh_.nodes.size());
  for (const Vector3& node : mesh_.nodes) elements_.emplace_back(grid.index(node) + Vector3::Ones());
  refuse_outside(mesh_, elements_, grid);
  const Vector3 size(double(grid.size[0]), double(grid.size[1]), double(grid.size[2]));
  std::vector<std::pair<std::uint32_t, std::uint32_t>> codes;
  for (std::uint32_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
    if (!(std::abs(signed_volume_m3(mesh_, t)) > 0)) {
      throw Error("tetrahedron " + std::to_string(t) + " of the mesh has no volume; repair the mesh");
    }
    Vector3 middle = Vector3::Zero();
    for (const std::uint32_t node : mesh_.tetrahedra[t]) middle += elements_[node] / 4;
    codes.emplace_back(interleaved(middle, size), t);
  }
  std::ranges::sort(codes);
  for (const auto& [code, t] : codes) order_.push_back(t);
}

namespace {

/// One deformed tetrahedron as the kernel takes it; nothing is to be seen of it where u1 stays 0.
RayCell cell_of(const std::array<Vector3, 4>& rest, const std::array<Vector3, 4>& deformed_m,
                const ProjectionGeometry& geometry, const ProjectionGeometry::PixelRays& rays) {
  RayCell cell;
  Eigen::Matrix3d rest_edges, edges;
  double longest = 0;
  for (int i = 0; i < 3; ++i) {
    rest_edges.col(i) = rest[std::size_t(i) + 1] - rest[0];
    edges.col(i) = deformed_m[std::size_t(i) + 1] - deformed_m[0];
    longest = std::max(longest, edges.col(i).squaredNorm());
  }
  longest = std::sqrt(longest);
  // Flat to rounding: no ray is long in it.
  if (!(std::abs(edges.determinant()) > 1e-12 * longest * longest * longest)) return cell;
  // Pixels it may be seen in.
  double u_least = 1e9, u_most = -1e9, v_least = 1e9, v_most = -1e9;
  for (const Vector3& node : deformed_m) {
    const Vector3 seen = geometry.matrix() * node.homogeneous();
    const double u = seen.x() / seen.z(), v = seen.y() / seen.z();
    u_least = std::min(u_least, u);
    u_most = std::max(u_most, u);
    v_least = std::min(v_least, v);
    v_most = std::max(v_most, v);
  }
  constexpr double kSlack = 0.01;
  const auto pixel = [](double at, std::size_t most) {
    return static_cast<std::int32_t>(std::clamp(at, 0.0, static_cast<double>(most)));
  };
  cell.u0 = pixel(std::ceil(u_least - kSlack), geometry.columns());
  cell.u1 = pixel(std::floor(u_most + kSlack) + 1, geometry.columns());
  cell.v0 = pixel(std::ceil(v_least - kSlack), geometry.rows());
  cell.v1 = pixel(std::floor(v_most + kSlack) + 1, geometry.rows());
  if (cell.u1 <= cell.u0 || cell.v1 <= cell.v0) return cell;

  // Gradients of the barycentric coordinates; these of the source, and their change along a ray.
  const Eigen::Matrix3d inverse = edges.inverse();
  const Vector3 corner = rays.corner + double(cell.u0) * rays.along_row + double(cell.v0) * rays.down_column;
  const Vector3 from_source = inverse * (geometry.source_m() - deformed_m[0]);
  const Vector3 along_corner = inverse * corner, along_u = inverse * rays.along_row,
                along_v = inverse * rays.down_column;
  cell.face_count = 4;
  std::int32_t front = 0, back = 4;
  for (Eigen::Index i = -1; i < 3; ++i) {
    // The first corner's coordinate is one less the others'.
    double source = i < 0 ? 1 - from_source.sum() : from_source[i];
    const auto of = [&](const Vector3& vector) { return i < 0 ? -vector.sum() : vector[i]; };
    // Seen edge on, the face is a cliff in w; it must not become infinitely steep.
    constexpr double kLeast = 1e-6;
    if (std::abs(source) < kLeast) source = std::copysign(kLeast, source);
    float* const face = cell.faces[source < 0 ? front++ : --back];
    face[0] = static_cast<float>(-of(along_corner) / source);
    face[1] = static_cast<float>(-of(along_u) / source);
    face[2] = static_cast<float>(-of(along_v) / source);
  }
  cell.fronts = front;

  const Vector3 middle = rest_edges * (along_corner + 0.5 * double(cell.u1 - cell.u0) * along_u +
                                       0.5 * double(cell.v1 - cell.v0) * along_v);
  Eigen::Index axis = 0;
  middle.cwiseAbs().maxCoeff(&axis);
  cell.axis = static_cast<std::int32_t>(axis);
  const auto at = static_cast<std::size_t>(axis);
  const std::array<Eigen::Index, 3> order{axis, RayVoxels::kColumnAxis[at], RayVoxels::kRowAxis[at]};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto row = rest_edges.row(order[i]);
    cell.map[i][0] = static_cast<float>(rest[0][order[i]] + row.dot(from_source));
    cell.map[i][1] = static_cast<float>(row.dot(along_corner));
    cell.map[i][2] = static_cast<float>(row.dot(along_u));
    cell.map[i][3] = static_cast<float>(row.dot(along_v));
  }
  cell.scale = 1;
  return cell;
}

}  // namespace

ProjectionImage MeshProjector::inside(const ProjectionGeometry& geometry,
                                      std::span<const Vector3> displacement_m, DensityRule rule) const {
  if (displacement_m.size() != mesh_.nodes.size()) {
    throw Error("there are displacements of " + std::to_string(displacement_m.size()) +
                " nodes; the mesh has " + std::to_string(mesh_.nodes.size()));
  }
  const ProjectionGeometry::PixelRays rays = pixel_rays_of(geometry);
  std::vector<Vector3> deformed_m(mesh_.nodes.size());
  Extent extent;
  for (std::size_t node = 0; node < deformed_m.size(); ++node) {
    deformed_m[node] = mesh_.nodes[node] + displacement_m[node];
    if (!(deformed_m[node].array().abs() <= kFarthestM).all()) {
      throw Error("the displacement of node " + std::to_string(node) +
                  " is no number or takes it out of the room; was it computed in the mesh's unit?");
    }
    if (node == 0) extent = {deformed_m[0], deformed_m[0]};
    extent.least = extent.least.cwiseMin(deformed_m[node]);
    extent.greatest = extent.greatest.cwiseMax(deformed_m[node]);
  }
  std::array<Vector3, 8> corners;
  for (unsigned corner = 0; corner < 8; ++corner) {
    for (unsigned axis = 0; axis < 3; ++axis) {
      corners[corner][axis] = (corner >> axis & 1U) != 0 ? extent.greatest[axis] : extent.least[axis];
    }
  }
  refuse_unseen(geometry, corners, "the deformed mesh");
  std::vector<RayCell> cells(order_.size());
  constexpr std::size_t kPart = 1024;
  for_each_part((cells.size() + kPart - 1) / kPart, ct_.options().threads, [&](std::size_t part) {
    for (std::size_t i = part * kPart; i < std::min((part + 1) * kPart, cells.size()); ++i) {
      const Tetrahedron& corners_of = mesh_.tetrahedra[order_[i]];
      std::array<Vector3, 4> rest, deformed;
      for (std::size_t corner = 0; corner < 4; ++corner) {
        rest[corner] = elements_[corners_of[corner]];
        deformed[corner] = deformed_m[corners_of[corner]];
      }
      cells[i] = cell_of(rest, deformed, geometry, rays);
      if (rule == DensityRule::kKeepMass && cells[i].face_count > 0) {
        const double volume_m3 =
            (deformed[1] - deformed[0]).cross(deformed[2] - deformed[0]).dot(deformed[3] - deformed[0]) / 6;
        cells[i].scale =
            static_cast<float>(std::min(std::abs(signed_volume_m3(mesh_, order_[i]) / volume_m3), kDensest));
      }
    }
  });
  return ct_.integrate(geometry, cells);
}

ProjectionImage MeshProjector::outside(const ProjectionGeometry& geometry) const {
  ProjectionImage image = ct_.project(geometry);
  const std::vector<Vector3> at_rest(mesh_.nodes.size(), Vector3::Zero());
  const ProjectionImage inside_at_rest = inside(geometry, at_rest);
  for (std::size_t i = 0; i < image.values.size(); ++i) image.values[i] -= inside_at_rest.values[i];
  return image;
}

ProjectionImage MeshProjector::project(const ProjectionGeometry& geometry,
                                       std::span<const Vector3> displacement_m, DensityRule rule) const {
  ProjectionImage image = outside(geometry);
  add_to(image, inside(geometry, displacement_m, rule));
  return image;
}

void add_to(ProjectionImage& image, const ProjectionImage& more) {
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] = std::max(image.values[i] + more.values[i], 0.0F);
  }
}

}  // namespace kiroku::sim

#include "sim/cutting/cut_curve.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include <Eigen/Geometry>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/cutting/closest_point.h"
#include "sim/mesh/length_unit.h"
#include "sim/mesh/mesh_topology.h"

namespace kiroku::sim {
namespace {

constexpr std::size_t kFineSteps = 32;      // from a handle to the next
constexpr std::size_t kMostHandles = 100;   // a document of strangers must not take minutes to be read
constexpr double kFarthestInEdges = 2;      // of a handle from the surface
constexpr double kLeastInward = 0.1;        // cosine of a direction with the inward normal
constexpr double kSamePlaceInEdges = 1e-3;  // two handles

std::string handle_text(std::size_t handle) { return "handle " + std::to_string(handle); }
std::string mm_text(double length_m) { return number_text(length_m * kMmPerM, 3) + " mm"; }

/// The faces that a body shows, and where they face.
class OrganSurface {
 public:
  explicit OrganSurface(const TetMesh& mesh)
      : mesh_(mesh), faces_(faces_of(mesh).surface), normals_(mesh.nodes.size(), Vector3::Zero()) {
    double sum_m = 0;
    for (const Face& face : faces_) {
      const std::array<Vector3, 3> at = corners(face);
      const Vector3 doubled = (at[1] - at[0]).cross(at[2] - at[0]);
      for (const std::uint32_t node : face.nodes) normals_[node] += doubled;
      for (std::size_t i = 0; i < 3; ++i) sum_m += (at[(i + 1) % 3] - at[i]).norm();
    }
    if (faces_.empty()) throw Error("the mesh has no surface that could be cut");
    mean_edge_m_ = sum_m / static_cast<double>(3 * faces_.size());
  }

  [[nodiscard]] double mean_edge_m() const { return mean_edge_m_; }

  struct Place {
    Vector3 point_m, outward;  // of unit length
  };
  [[nodiscard]] Place nearest(const Vector3& point_m) const {
    Place nearest{point_m, Vector3::UnitZ()};
    double least_m2 = -1;
    for (const Face& face : faces_) {
      const std::array<Vector3, 3> at = corners(face);
      const Vector3 weights = closest_weights(point_m, at);
      const Vector3 there_m = weights[0] * at[0] + weights[1] * at[1] + weights[2] * at[2];
      const double distance_m2 = (there_m - point_m).squaredNorm();
      if (least_m2 >= 0 && distance_m2 >= least_m2) continue;
      least_m2 = distance_m2;
      nearest.point_m = there_m;
      nearest.outward = Vector3::Zero();
      for (std::size_t i = 0; i < 3; ++i)
        nearest.outward += weights[static_cast<Eigen::Index>(i)] * normals_[face.nodes[i]].normalized();
      nearest.outward.normalize();
    }
    return nearest;
  }

 private:
  [[nodiscard]] std::array<Vector3, 3> corners(const Face& face) const {
    return {mesh_.nodes[face.nodes[0]], mesh_.nodes[face.nodes[1]], mesh_.nodes[face.nodes[2]]};
  }

  const TetMesh& mesh_;
  std::vector<Face> faces_;
  std::vector<Vector3> normals_;  // (|V|), of the faces around each node, as large as these
  double mean_edge_m_ = 0;
};

/// From `points[1]` to `points[2]`, by the pyramid of Barry and Goldman; `part` from 0 to 1.
Vector3 catmull_rom(const std::array<Vector3, 4>& points, double part) {
  std::array<double, 4> knot{};
  for (std::size_t i = 1; i < 4; ++i) knot[i] = knot[i - 1] + std::sqrt((points[i] - points[i - 1]).norm());
  const double at = knot[1] + part * (knot[2] - knot[1]);
  std::array<Vector3, 4> level = points;
  for (std::size_t width = 1; width < 4; ++width) {
    for (std::size_t i = 0; i + width < 4; ++i) {
      // The last level goes over the middle interval alone.
      const double from = width == 3 ? knot[1] : knot[i], to = width == 3 ? knot[2] : knot[i + width];
      level[i] = ((to - at) * level[i] + (at - from) * level[i + 1]) / (to - from);
    }
  }
  return level[0];
}

/// Beyond the ends the curve goes on as it came.
Vector3 handle_at(const std::vector<Vector3>& handles_m, std::ptrdiff_t handle) {
  const auto last = static_cast<std::ptrdiff_t>(handles_m.size()) - 1;
  if (handle < 0) return 2 * handles_m[0] - handles_m[1];
  if (handle > last) return 2 * handles_m.back() - handles_m[handles_m.size() - 2];
  return handles_m[static_cast<std::size_t>(handle)];
}

void check(const CutCurve& curve, const OrganSurface& surface, double edge_m) {
  const std::size_t count = curve.handles_m.size();
  if (count < 2) throw Error("a curve needs two handles at least: it has " + std::to_string(count));
  if (count > kMostHandles) {
    throw Error("a curve has " + std::to_string(kMostHandles) + " handles at most: it has " +
                std::to_string(count));
  }
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3& handle_m = curve.handles_m[i];
    if (!handle_m.allFinite()) throw Error(handle_text(i) + " is not finite");
    if (i > 0 && (handle_m - curve.handles_m[i - 1]).norm() < kSamePlaceInEdges * surface.mean_edge_m())
      throw Error(handle_text(i) + " is where " + handle_text(i - 1) + " is: leave one of them out");
    const double off_m = (surface.nearest(handle_m).point_m - handle_m).norm();
    if (off_m > kFarthestInEdges * surface.mean_edge_m()) {
      throw Error(handle_text(i) + " is " + mm_text(off_m) + " off the organ's surface: place it on it (" +
                  mm_text(kFarthestInEdges * surface.mean_edge_m()) + " are allowed)");
    }
  }
  if (curve.depth_m.size() != 1 && curve.depth_m.size() != count) {
    throw Error("a curve has one depth for all handles or one for each: it has " +
                std::to_string(curve.depth_m.size()) + " for " + std::to_string(count) + " handles");
  }
  for (const double depth_m : curve.depth_m) {
    if (!(depth_m > 0))
      throw Error("a depth of " + mm_text(depth_m) + " cuts nothing: it must be greater than 0");
    if (!(depth_m < edge_m)) {
      throw Error("a depth of " + mm_text(depth_m) + " needs a blade whose edge is longer: it has " +
                  mm_text(edge_m));
    }
  }
  if (curve.direction && !(curve.direction->allFinite() && curve.direction->norm() > 0))
    throw Error("the direction of the cut has no length");
}

}  // namespace

std::vector<BladePose> blade_along(const CutCurve& curve, const TetMesh& mesh, double edge_m,
                                   double spacing_m) {
  const OrganSurface surface(mesh);
  check(curve, surface, edge_m);
  // Finely first, on the surface, so that its length is known.
  std::vector<Vector3> fine_m;
  std::vector<double> along_m;  // the length up to there
  const std::size_t segments = curve.handles_m.size() - 1;
  for (std::size_t i = 0; i <= segments * kFineSteps; ++i) {
    const std::size_t segment = std::min(i / kFineSteps, segments - 1);
    const double part = static_cast<double>(i - segment * kFineSteps) / kFineSteps;
    const auto first = static_cast<std::ptrdiff_t>(segment);
    const std::array<Vector3, 4> points{
        handle_at(curve.handles_m, first - 1), handle_at(curve.handles_m, first),
        handle_at(curve.handles_m, first + 1), handle_at(curve.handles_m, first + 2)};
    const Vector3 drawn_m =
        curve.smooth ? catmull_rom(points, part) : Vector3(points[1] + part * (points[2] - points[1]));
    fine_m.push_back(surface.nearest(drawn_m).point_m);
    along_m.push_back(i == 0 ? 0 : along_m.back() + (fine_m[i] - fine_m[i - 1]).norm());
  }
  const auto steps =
      std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(along_m.back() / spacing_m)));
  std::vector<OrganSurface::Place> places;
  std::vector<double> depth_m;
  std::size_t before = 0;
  for (std::size_t step = 0; step <= steps; ++step) {
    const double at_m = along_m.back() * static_cast<double>(step) / static_cast<double>(steps);
    while (before + 2 < along_m.size() && along_m[before + 1] < at_m) ++before;
    const double length_m = along_m[before + 1] - along_m[before];
    const double part = length_m > 0 ? std::clamp((at_m - along_m[before]) / length_m, 0.0, 1.0) : 0;
    places.push_back(surface.nearest(fine_m[before] + part * (fine_m[before + 1] - fine_m[before])));
    const double handle = (static_cast<double>(before) + part) / kFineSteps;
    const std::size_t first = std::min(static_cast<std::size_t>(handle), segments - 1);
    const double further = handle - static_cast<double>(first);
    depth_m.push_back(curve.depth_m.size() == 1 ? curve.depth_m.front()
                                                : curve.depth_m[first] + further * (curve.depth_m[first + 1] -
                                                                                    curve.depth_m[first]));
  }
  std::vector<BladePose> path;
  for (std::size_t i = 0; i < places.size(); ++i) {
    // The normal of one face of a coarse mesh would make the blade wobble.
    Vector3 inward = -2 * places[i].outward;
    if (i > 0) inward -= places[i - 1].outward;
    if (i + 1 < places.size()) inward -= places[i + 1].outward;
    inward.normalize();
    if (curve.direction) {
      const Vector3 direction = curve.direction->normalized();
      if (direction.dot(inward) < kLeastInward) {
        const Vector3 at_mm = kMmPerM * places[i].point_m;
        throw Error("the direction of the cut leads along the organ's surface or out of it at " +
                    number_text(at_mm.x(), 4) + ", " + number_text(at_mm.y(), 4) + ", " +
                    number_text(at_mm.z(), 4) + " mm: turn it inward, or leave it out");
      }
      inward = direction;
    }
    const Vector3 tip_m = places[i].point_m + depth_m[i] * inward;
    path.push_back({tip_m, tip_m - edge_m * inward});
  }
  return path;
}

std::vector<Vector3> on_surface(const TetMesh& mesh, const std::vector<Vector3>& points_m) {
  const OrganSurface surface(mesh);
  std::vector<Vector3> nearest_m;
  for (const Vector3& point_m : points_m) nearest_m.push_back(surface.nearest(point_m).point_m);
  return nearest_m;
}

}  // namespace kiroku::sim

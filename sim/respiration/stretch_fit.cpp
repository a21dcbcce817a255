#include "sim/respiration/stretch_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "sim/mesh/mesh_topology.h"

namespace kiroku::sim {
namespace {

constexpr double kFarthestM = 0.03;        // what a place without a partner counts as
constexpr double kPartnerCosine = 0.3;     // of two normals, for surfaces that may be the same
constexpr std::size_t kPointsAsked = 800;  // of the second surface; they tell a few dozen numbers

/// The centre of a body, and how far it reaches from there along each axis.
struct Moments {
  Vector3 centre_m = Vector3::Zero(), deviation_m = Vector3::Zero();
};

class MomentSum {
 public:
  void take(double volume, const Vector3& place_m) {
    volume_ += volume;
    first_ += volume * place_m;
    second_ += volume * place_m.cwiseAbs2();
  }
  [[nodiscard]] Moments moments() const {
    const Vector3 centre_m = first_ / volume_;
    return {centre_m, (second_ / volume_ - centre_m.cwiseAbs2()).cwiseMax(0).cwiseSqrt()};
  }

 private:
  double volume_ = 0;
  Vector3 first_ = Vector3::Zero(), second_ = Vector3::Zero();
};

Moments moments_of(const TetMesh& mesh) {
  MomentSum sum;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    // Exact for squares: four points of equal weight (Hammer, Marlowe and Stroud, 1956).
    constexpr double kNear = 0.58541020, kFar = 0.13819660;
    const double quarter_m3 = signed_volume_m3(mesh, t) / 4;
    Vector3 all = Vector3::Zero();
    for (const std::uint32_t node : mesh.tetrahedra[t]) all += mesh.nodes[node];
    for (const std::uint32_t node : mesh.tetrahedra[t])
      sum.take(quarter_m3, kFar * all + (kNear - kFar) * mesh.nodes[node]);
  }
  return sum.moments();
}

Moments moments_of(const DistanceField& field) {
  MomentSum sum;
  for (std::size_t k = 0, offset = 0; k < field.grid.size[2]; ++k) {
    for (std::size_t j = 0; j < field.grid.size[1]; ++j) {
      for (std::size_t i = 0; i < field.grid.size[0]; ++i, ++offset) {
        if (field.distance_m[offset] >= 0) continue;
        const Vector3 index(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k));
        sum.take(1, field.grid.patient_m(index));
      }
    }
  }
  return sum.moments();
}

/// Partners of the lung's surface nodes, and of points of the second surface.
class Partners {
 public:
  Partners(const LungSurface& surface, const DistanceField& second, const SurfacePoints& points)
      : surface_(surface), second_(second), points_(points) {
    stride_ = std::max<std::size_t>(1, points.places_m.size() / kPointsAsked);
    double area_m2 = 0;
    for (const double part_m2 : surface.areas_m2) area_m2 += part_m2;
    each_m2_ = area_m2 * static_cast<double>(stride_) /
               static_cast<double>(std::max<std::size_t>(1, points.places_m.size()));
  }

  /// Nodes (rows) lie at `places_m` with `normals`. Tells `take` of each pair its weight, the row, the
  /// direction that their distance is along and the distance, and `miss` the weight of what has no partner.
  template <typename Take, typename Miss>
  void find(const std::vector<Vector3>& places_m, const std::vector<Vector3>& normals, Take take,
            Miss miss) const {
    for (std::size_t row = 0; row < places_m.size(); ++row) {
      const SignedDistance found = sample(second_, places_m[row]);
      const double slope = found.gradient.norm();
      if (slope > 0 && found.gradient.dot(normals[row]) > kPartnerCosine * slope) {
        take(surface_.areas_m2[row], row, Vector3(found.gradient / slope), found.distance_m);
      } else {
        miss(surface_.areas_m2[row]);
      }
    }
    for (std::size_t p = 0; p < points_.places_m.size(); p += stride_) {
      const Vector3 &point_m = points_.places_m[p], &normal = points_.normals[p];
      std::size_t nearest = places_m.size();
      double least = kFarthestM * kFarthestM;
      for (std::size_t row = 0; row < places_m.size(); ++row) {
        const double square = (places_m[row] - point_m).squaredNorm();
        if (square >= least || normals[row].dot(normal) < kPartnerCosine) continue;
        least = square;
        nearest = row;
      }
      if (nearest == places_m.size()) {
        miss(each_m2_);
      } else {
        take(each_m2_, nearest, normal, normal.dot(places_m[nearest] - point_m));
      }
    }
  }

 private:
  const LungSurface& surface_;
  const DistanceField& second_;
  const SurfacePoints& points_;
  std::size_t stride_ = 1;
  double each_m2_ = 0;
};

/// Mean of the distances so far.
struct MeanDistance {
  double weights = 0, sum_m = 0;
  void take(double weight, double distance_m) {
    weights += weight;
    sum_m += weight * std::min(std::abs(distance_m), kFarthestM);
  }
  [[nodiscard]] double mean_m() const { return sum_m / weights; }
};

/// Parts of the lung, each moved by an affine motion of its own.
class StretchedParts {
 public:
  /// `part_of_row` (|S|) counts from 0.
  StretchedParts(const TetMesh& mesh, const LungSurface& surface, const Partners& partners,
                 std::vector<std::size_t> part_of_row, std::size_t parts)
      : surface_(surface), partners_(partners), part_of_row_(std::move(part_of_row)), frames_(parts) {
    for (const std::uint32_t node : surface.nodes) first_m_.push_back(mesh.nodes[node]);
    std::vector<MomentSum> sums(parts);
    for (std::size_t row = 0; row < first_m_.size(); ++row)
      sums[part_of_row_[row]].take(surface.areas_m2[row], first_m_[row]);
    for (std::size_t part = 0; part < parts; ++part) {
      const Moments found = sums[part].moments();
      frames_[part] = {found.centre_m, found.deviation_m.norm()};
    }
  }

  /// Gauss-Newton steps on the distances, which count as absolute values beyond `robust_m` (Huber); the best
  /// of what is passed on the way, by the mean distance, which is given back.
  double improve(std::vector<Eigen::Affine3d>& motions, double robust_m) const {
    constexpr int kSteps = 25;
    constexpr double kSmallestChangeM = 1e-5;
    std::vector<Eigen::Affine3d> best = motions;
    double least_m = std::numeric_limits<double>::infinity();
    for (int step = 0; step < kSteps; ++step) {
      std::vector<Equations> equations(frames_.size());
      MeanDistance mean;
      gather(motions, robust_m, equations, mean);
      if (mean.mean_m() < least_m) {
        least_m = mean.mean_m();
        best = motions;
      }
      double change_m = 0;
      for (std::size_t part = 0; part < frames_.size(); ++part)
        change_m = std::max(change_m, apply(equations[part], frames_[part], motions[part]));
      if (change_m < kSmallestChangeM) break;
    }
    motions = best;
    return least_m;
  }

 private:
  // About the part's centre and in its own size, so that the unknowns are of one kind.
  struct Frame {
    Vector3 centre_m = Vector3::Zero();
    double size_m = 1;
  };
  struct Equations {
    Eigen::Matrix<double, 12, 12> normal = Eigen::Matrix<double, 12, 12>::Zero();
    Eigen::Matrix<double, 12, 1> right = Eigen::Matrix<double, 12, 1>::Zero();
  };

  void gather(const std::vector<Eigen::Affine3d>& motions, double robust_m, std::vector<Equations>& equations,
              MeanDistance& mean) const {
    std::vector<Vector3> places_m(first_m_.size()), normals(first_m_.size());
    std::vector<Eigen::Matrix3d> to_normals;
    for (const Eigen::Affine3d& motion : motions)
      to_normals.emplace_back(motion.linear().inverse().transpose());
    for (std::size_t row = 0; row < first_m_.size(); ++row) {
      places_m[row] = motions[part_of_row_[row]] * first_m_[row];
      normals[row] = (to_normals[part_of_row_[row]] * surface_.normals[row]).normalized();
    }
    partners_.find(
        places_m, normals,
        [&](double weight, std::size_t row, const Vector3& direction, double distance_m) {
          mean.take(weight, distance_m);
          weight *= std::min(1.0, robust_m / std::max(std::abs(distance_m), 1e-12));
          const Frame& frame = frames_[part_of_row_[row]];
          const Vector3 arm = (first_m_[row] - frame.centre_m) / frame.size_m;
          Eigen::Matrix<double, 12, 1> along;
          along << direction, arm.x() * direction, arm.y() * direction, arm.z() * direction;
          Equations& of_part = equations[part_of_row_[row]];
          of_part.normal += weight * along * along.transpose();
          of_part.right -= weight * distance_m * along;
        },
        [&](double weight) { mean.take(weight, kFarthestM); });
  }

  /// How far it moves the part, m. A step that would turn it inside out is not taken.
  static double apply(Equations& equations, const Frame& frame, Eigen::Affine3d& motion) {
    // What nothing asks for stays as it is.
    constexpr double kStay = 1e-6;
    const double stay = kStay * equations.normal.trace() / 12;
    if (!(stay > 0)) return 0;
    equations.normal.diagonal().array() += stay;
    const Eigen::Matrix<double, 12, 1> change_m = equations.normal.ldlt().solve(equations.right);
    Eigen::Matrix3d stretch;
    stretch << change_m.segment<3>(3), change_m.segment<3>(6), change_m.segment<3>(9);
    stretch /= frame.size_m;
    Eigen::Affine3d next = motion;
    next.linear() += stretch;
    next.translation() += change_m.head<3>() - stretch * frame.centre_m;
    if (!(next.linear().determinant() > 0)) return 0;
    motion = next;
    return change_m.norm();
  }

  const LungSurface& surface_;
  const Partners& partners_;
  std::vector<std::size_t> part_of_row_;
  std::vector<Vector3> first_m_;  // (|S|)
  std::vector<Frame> frames_;
};

/// Of each node in use (|V|), the large part that it belongs to, counted from 1; 0 for all others.
struct LargeParts {
  std::size_t count = 0;
  std::vector<std::size_t> of_node;
};

LargeParts large_parts(const TetMesh& mesh, const LungSurface& surface) {
  constexpr double kLargeShare = 0.1;
  const Parts parts = node_connected_parts(mesh);
  std::vector<std::size_t> of_node(mesh.nodes.size(), 0);
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (const std::uint32_t node : mesh.tetrahedra[t]) of_node[node] = parts.of_tetrahedron[t];
  }
  std::vector<double> areas_m2(parts.count, 0);
  double area_m2 = 0;
  for (std::size_t row = 0; row < surface.nodes.size(); ++row) {
    areas_m2[of_node[surface.nodes[row]]] += surface.areas_m2[row];
    area_m2 += surface.areas_m2[row];
  }
  LargeParts large;
  std::vector<std::size_t> number(parts.count, 0);
  for (std::size_t part = 0; part < parts.count; ++part) {
    if (areas_m2[part] > kLargeShare * area_m2) number[part] = ++large.count;
  }
  const std::vector<bool> used = nodes_in_use(mesh);
  for (std::size_t node = 0; node < of_node.size(); ++node)
    large.of_node.push_back(used[node] ? number[of_node[node]] : 0);
  return large;
}

}  // namespace

StretchFit fit_stretch(const TetMesh& mesh, const LungSurface& surface, const DistanceField& second,
                       const SurfacePoints& points) {
  // Coarse first: after a deep breath most distances are larger than the finer figure.
  constexpr std::array<double, 2> kScalesM{0.02, 0.005};
  const Moments first = moments_of(mesh), other = moments_of(second);
  std::vector<Eigen::Affine3d> starts(3, Eigen::Affine3d::Identity());
  starts[1].translate(other.centre_m - first.centre_m);
  starts[2]
      .translate(other.centre_m)
      .scale(other.deviation_m.cwiseQuotient(first.deviation_m))
      .translate(-first.centre_m);
  const Partners partners(surface, second, points);
  const StretchedParts all(mesh, surface, partners, std::vector<std::size_t>(surface.nodes.size(), 0), 1);
  StretchFit fit;
  double least_m = std::numeric_limits<double>::infinity();
  for (const Eigen::Affine3d& start : starts) {
    std::vector<Eigen::Affine3d> motion{start};
    double left_m = 0;
    for (const double robust_m : kScalesM) left_m = all.improve(motion, robust_m);
    if (left_m >= least_m) continue;
    least_m = left_m;
    fit.whole = motion[0];
  }

  // Each lung by itself, from there.
  const LargeParts large = large_parts(mesh, surface);
  std::vector<Eigen::Affine3d> motions(large.count + 1, fit.whole);
  std::vector<std::size_t> part_of_row;
  for (const std::uint32_t node : surface.nodes) part_of_row.push_back(large.of_node[node]);
  if (large.count > 1) {
    const StretchedParts each(mesh, surface, partners, part_of_row, motions.size());
    std::vector<Eigen::Affine3d> own = motions;
    if (each.improve(own, kScalesM.back()) < least_m) motions = own;
    motions[0] = fit.whole;
  }
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node)
    fit.places_m.emplace_back(motions[large.of_node[node]] * mesh.nodes[node]);
  return fit;
}

double both_ways_m(const LungSurface& surface, const DistanceField& second, const SurfacePoints& points,
                   const std::vector<Vector3>& places_m) {
  std::vector<Vector3> rows_m;
  for (const std::uint32_t node : surface.nodes) rows_m.push_back(places_m[node]);
  MeanDistance mean;
  Partners(surface, second, points)
      .find(
          rows_m, normals_at(surface, places_m),
          [&](double weight, std::size_t, const Vector3&, double distance_m) {
            mean.take(weight, distance_m);
          },
          [&](double weight) { mean.take(weight, kFarthestM); });
  return mean.mean_m();
}

}  // namespace kiroku::sim

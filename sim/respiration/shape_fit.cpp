#include "sim/respiration/shape_fit.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>

#include "base/error.h"
#include "sim/fem/number_text.h"

namespace kiroku::sim {
namespace {

Eigen::Index at(std::size_t node) { return static_cast<Eigen::Index>(3 * node); }

Eigen::Matrix3d cross_matrix(const Vector3& v) {
  Eigen::Matrix3d matrix;
  matrix << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return matrix;
}

struct MovedVolume {
  double volume_m3 = 0;
  std::size_t inverted = 0;
};

MovedVolume volume_of(const TetMesh& mesh, const Eigen::VectorXd& displacement_m) {
  TetMesh moved = mesh;
  for (std::size_t node = 0; node < moved.nodes.size(); ++node)
    moved.nodes[node] += displacement_m.segment<3>(at(node));
  MovedVolume sum;
  for (std::size_t t = 0; t < moved.tetrahedra.size(); ++t) {
    const double volume_m3 = signed_volume_m3(moved, t);
    sum.volume_m3 += volume_m3;
    if (!(volume_m3 > 0)) ++sum.inverted;
  }
  return sum;
}

/// The surface of a lung that is placed, and moved by a sum of responses.
class SurfaceFit {
 public:
  SurfaceFit(const TetMesh& mesh, const LungSurface& surface, const DistanceField& second)
      : mesh_(mesh), surface_(surface), second_(second) {
    for (const std::uint32_t node : surface.nodes) centre_m_ += mesh.nodes[node];
    centre_m_ /= static_cast<double>(surface.nodes.size());
  }

  [[nodiscard]] Vector3 place(const Eigen::Isometry3d& placement, const Eigen::VectorXd& displacement_m,
                              std::size_t row) const {
    const std::uint32_t node = surface_.nodes[row];
    return placement * (mesh_.nodes[node] + displacement_m.segment<3>(at(node)));
  }

  [[nodiscard]] std::vector<double> distances(const Eigen::Isometry3d& placement,
                                              const Eigen::VectorXd& displacement_m) const {
    std::vector<double> distances;
    distances.reserve(surface_.nodes.size());
    for (std::size_t row = 0; row < surface_.nodes.size(); ++row)
      distances.push_back(std::abs(sample(second_, place(placement, displacement_m, row)).distance_m));
    return distances;
  }

  /// Least squares of the distances of nodes that count, weighted by area and, beyond `robust_m`, as absolute
  /// values (Huber). Unknowns are the rigid motion and the factors of the responses.
  void minimise(const std::vector<bool>& counts, const std::vector<Eigen::VectorXd>& responses,
                double robust_m, Eigen::Isometry3d& placement, Eigen::VectorXd& factors) const {
    constexpr int kMostSteps = 100;
    constexpr double kSmallestGain = 1e-9, kMostDamping = 1e12;
    const auto unknowns = static_cast<Eigen::Index>(6 + responses.size());
    double damping = 1e-3;
    double cost = cost_of(counts, responses, robust_m, placement, factors);
    for (int step = 0; step < kMostSteps && damping < kMostDamping; ++step) {
      Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(unknowns, unknowns);
      Eigen::VectorXd right = Eigen::VectorXd::Zero(unknowns);
      const Eigen::VectorXd displacement_m = sum_of(responses, factors, at(mesh_.nodes.size()));
      Eigen::VectorXd row_of(unknowns);
      for (std::size_t row = 0; row < surface_.nodes.size(); ++row) {
        if (!counts[row]) continue;
        const Vector3 placed_m = place(placement, displacement_m, row);
        const SignedDistance distance = sample(second_, placed_m);
        row_of.head<3>() = distance.gradient;
        row_of.segment<3>(3) = cross_matrix(placed_m - placement * centre_m_) * distance.gradient;
        for (std::size_t i = 0; i < responses.size(); ++i) {
          row_of[static_cast<Eigen::Index>(6 + i)] =
              distance.gradient.dot(placement.linear() * responses[i].segment<3>(at(surface_.nodes[row])));
        }
        const double weight =
            surface_.areas_m2[row] * std::min(1.0, robust_m / std::max(std::abs(distance.distance_m), 1e-12));
        normal += weight * row_of * row_of.transpose();
        right -= weight * distance.distance_m * row_of;
      }
      for (;;) {
        Eigen::MatrixXd damped = normal;
        damped.diagonal() +=
            damping * (normal.diagonal().array() + 1e-12 * normal.diagonal().maxCoeff()).matrix();
        const Eigen::VectorXd change = damped.ldlt().solve(right);
        const Eigen::Isometry3d next = moved(placement, change.head<6>());
        const Eigen::VectorXd next_factors = factors + change.tail(factors.size());
        const double next_cost = cost_of(counts, responses, robust_m, next, next_factors);
        if (next_cost < cost) {
          const bool done = cost - next_cost < kSmallestGain * cost;
          placement = next;
          factors = next_factors;
          cost = next_cost;
          damping = std::max(damping / 10, 1e-9);
          if (done) return;
          break;
        }
        damping *= 10;
        if (damping >= kMostDamping) return;
      }
    }
  }

  [[nodiscard]] static Eigen::VectorXd sum_of(const std::vector<Eigen::VectorXd>& responses,
                                              const Eigen::VectorXd& factors, Eigen::Index size) {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(size);
    for (std::size_t i = 0; i < responses.size(); ++i)
      sum += factors[static_cast<Eigen::Index>(i)] * responses[i];
    return sum;
  }

 private:
  [[nodiscard]] Eigen::Isometry3d moved(const Eigen::Isometry3d& placement,
                                        const Eigen::VectorXd& change) const {
    const Vector3 turn = change.segment<3>(3), pivot_m = placement * centre_m_;
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    motion.translate(pivot_m + change.head<3>());
    if (turn.norm() > 0) motion.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
    motion.translate(-pivot_m);
    return motion * placement;
  }

  [[nodiscard]] double cost_of(const std::vector<bool>& counts, const std::vector<Eigen::VectorXd>& responses,
                               double robust_m, const Eigen::Isometry3d& placement,
                               const Eigen::VectorXd& factors) const {
    const Eigen::VectorXd displacement_m = sum_of(responses, factors, at(mesh_.nodes.size()));
    double cost = 0;
    for (std::size_t row = 0; row < surface_.nodes.size(); ++row) {
      if (!counts[row]) continue;
      const double distance_m = std::abs(sample(second_, place(placement, displacement_m, row)).distance_m);
      cost += surface_.areas_m2[row] *
              (distance_m <= robust_m ? distance_m * distance_m : robust_m * (2 * distance_m - robust_m));
    }
    return cost;
  }

  const TetMesh& mesh_;
  const LungSurface& surface_;
  const DistanceField& second_;
  Vector3 centre_m_ = Vector3::Zero();
};

/// How far along `direction` the second surface is, where that direction leaves its body: the nearest such
/// place on either side; nothing within reach.
std::optional<double> crossing_m(const DistanceField& second, const Vector3& from_m,
                                 const Vector3& direction) {
  constexpr double kStepM = 0.0005;
  constexpr int kReach = 60;
  const auto at_step = [&](int step) {
    return sample(second, from_m + kStepM * static_cast<double>(step) * direction).distance_m;
  };
  const auto between = [&](double inside, double outside, int step) {
    return kStepM * (static_cast<double>(step) + inside / (inside - outside));
  };
  double ahead = at_step(0), behind = ahead;
  for (int step = 1; step <= kReach; ++step) {
    const double next = at_step(step), before = at_step(-step);
    if (ahead < 0 && next >= 0) return between(ahead, next, step - 1);
    if (before < 0 && behind >= 0) return between(before, behind, -step);
    ahead = next;
    behind = before;
  }
  return std::nullopt;
}

/// Of nodes without a value: what their neighbours say, from the known ones inwards.
void fill(const LungSurface& surface, const std::vector<bool>& known, std::vector<double>& values) {
  constexpr int kSweeps = 200;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (std::size_t row = 0; row < values.size(); ++row) {
      if (known[row] || surface.neighbours[row].empty()) continue;
      double sum = 0;
      for (const std::uint32_t beside : surface.neighbours[row]) sum += values[beside];
      values[row] = sum / static_cast<double>(surface.neighbours[row].size());
    }
  }
}

/// Every node of the surface is prescribed along its normal, to where that meets the second surface, and is
/// free to slide across it. Where it is then, the normal meets the surface elsewhere: again, until that is
/// the same place.
Eigen::VectorXd slide_to(const BreathingModel& model, const LungSurface& surface, const DistanceField& second,
                         const Eigen::Isometry3d& placement, const Eigen::VectorXd& from_m) {
  constexpr int kSteps = 8;
  constexpr double kOutlierM = 0.006, kEven = 0.3;  // the latter: how far towards the neighbours' mean
  Constraints constraints(model.mesh.nodes.size());
  for (std::size_t row = 0; row < surface.nodes.size(); ++row) {
    const Vector3& normal = surface.normals[row];
    Eigen::Matrix3d axes;
    axes.col(0) = normal.unitOrthogonal();
    axes.col(1) = normal.cross(axes.col(0));
    axes.col(2) = normal;
    constraints.turn(surface.nodes[row], axes);
    constraints.prescribe(surface.nodes[row], 2, 0, "surface");
  }
  const ElasticBody body(model.mesh, model.materials, std::move(constraints));
  const Eigen::VectorXd no_force_n = Eigen::VectorXd::Zero(from_m.size());
  Eigen::VectorXd prescribed_m = Eigen::VectorXd::Zero(from_m.size());
  std::vector<double> along_m(surface.nodes.size());
  Eigen::VectorXd displacement_m = from_m;
  for (int step = 0; step < kSteps; ++step) {
    std::vector<bool> known(surface.nodes.size());
    for (std::size_t row = 0; row < surface.nodes.size(); ++row) {
      const std::uint32_t node = surface.nodes[row];
      const Vector3 moved_m = displacement_m.segment<3>(at(node));
      along_m[row] = surface.normals[row].dot(moved_m);
      const auto crossing = crossing_m(second, placement * (model.mesh.nodes[node] + moved_m),
                                       placement.linear() * surface.normals[row]);
      known[row] = crossing.has_value();
      if (crossing) along_m[row] += *crossing;
    }
    fill(surface, known, along_m);
    // What its neighbours do not share is another part of the second surface.
    for (std::size_t row = 0; row < surface.nodes.size(); ++row) {
      std::vector<double> beside_m;
      for (const std::uint32_t beside : surface.neighbours[row]) beside_m.push_back(along_m[beside]);
      if (beside_m.empty()) continue;
      const auto middle = beside_m.begin() + static_cast<std::ptrdiff_t>(beside_m.size() / 2);
      std::nth_element(beside_m.begin(), middle, beside_m.end());
      if (std::abs(along_m[row] - *middle) > kOutlierM) known[row] = false;
    }
    fill(surface, known, along_m);
    std::vector<double> even_m = along_m;
    for (std::size_t row = 0; row < surface.nodes.size(); ++row) {
      double sum = 0;
      for (const std::uint32_t beside : surface.neighbours[row]) sum += along_m[beside];
      if (!surface.neighbours[row].empty())
        even_m[row] += kEven * (sum / static_cast<double>(surface.neighbours[row].size()) - along_m[row]);
    }
    for (std::size_t row = 0; row < surface.nodes.size(); ++row)
      prescribed_m[at(surface.nodes[row]) + 2] = even_m[row];
    displacement_m = body.solve(no_force_n, prescribed_m).displacement_m;
  }
  return displacement_m;
}

double labelled_m3(const LabelMap& map) {
  return static_cast<double>(map.labels.size() -
                             static_cast<std::size_t>(std::ranges::count(map.labels, std::uint16_t{0}))) *
         map.grid.spacing_m.prod();
}

/// The mask with air around, so that a surface at the side of the volume is one too.
LabelMap padded(const LabelMap& map) {
  constexpr std::size_t kMargin = 2;
  LabelMap wide{map.grid, {}};
  for (std::size_t axis = 0; axis < 3; ++axis) wide.grid.size[axis] += 2 * kMargin;
  wide.grid.origin_m = map.grid.patient_m(Vector3::Constant(-double{kMargin}));
  wide.labels.assign(wide.grid.voxels(), 0);
  for (std::size_t k = 0; k < map.grid.size[2]; ++k) {
    for (std::size_t j = 0; j < map.grid.size[1]; ++j) {
      for (std::size_t i = 0; i < map.grid.size[0]; ++i)
        wide.labels[wide.grid.offset(i + kMargin, j + kMargin, k + kMargin)] =
            map.labels[map.grid.offset(i, j, k)];
    }
  }
  return wide;
}

Vector3 centre_of(const LabelMap& map) {
  Vector3 sum = Vector3::Zero();
  double count = 0;
  for (std::size_t k = 0; k < map.grid.size[2]; ++k) {
    for (std::size_t j = 0; j < map.grid.size[1]; ++j) {
      for (std::size_t i = 0; i < map.grid.size[0]; ++i) {
        if (map.labels[map.grid.offset(i, j, k)] == 0) continue;
        sum += Vector3(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k));
        ++count;
      }
    }
  }
  return map.grid.patient_m(sum / count);
}

}  // namespace

ShapeFitResult fit_shape(const BreathingModel& model, const LabelMap& second, const ShapeFitOptions& options,
                         const std::function<void(const std::string&)>& step) {
  const auto tell = [&](const std::string& what) {
    if (step) step(what);
  };
  const Eigen::VectorXd still_m = Eigen::VectorXd::Zero(at(model.mesh.nodes.size()));
  ShapeFitResult result;
  result.motion = model.motion;
  result.first_volume_m3 = volume_of(model.mesh, still_m).volume_m3;
  result.second_volume_m3 = labelled_m3(second);
  constexpr double kMostRatio = 5;
  const double ratio = result.second_volume_m3 / result.first_volume_m3;
  if (!(ratio <= kMostRatio && ratio >= 1 / kMostRatio)) {
    throw Error("the second shape has " + number_text(1e6 * result.second_volume_m3, 3) +
                " ml and the lung " + number_text(1e6 * result.first_volume_m3, 3) +
                " ml: they are not the same lung");
  }
  tell("distances to the second shape");
  const DistanceField field = signed_distance(padded(second));
  tell("responses of the lung");
  const BreathingBody body(model.mesh, model.materials, model.groups, model.slide);
  const LungSurface& surface = body.surface();
  const SurfaceFit fit(model.mesh, surface, field);

  const auto record = [&](const std::string& name, const Eigen::Isometry3d& placement,
                          const Eigen::VectorXd& displacement_m) {
    const MovedVolume volume = volume_of(model.mesh, displacement_m);
    result.steps.push_back({name, placement, displacement_m,
                            spread_of(fit.distances(placement, displacement_m)), volume.volume_m3,
                            volume.inverted});
  };

  tell("rigid motion");
  constexpr double kRobustM = 0.005;
  std::vector<bool> outline(surface.nodes.size());
  Vector3 first_centre = Vector3::Zero();
  for (const Tetrahedron& corners : model.mesh.tetrahedra) {
    for (const std::uint32_t node : corners)
      first_centre += model.mesh.nodes[node] / (4 * static_cast<double>(model.mesh.tetrahedra.size()));
  }
  for (std::size_t row = 0; row < outline.size(); ++row)
    outline[row] = model.groups[surface.nodes[row]] != BoundaryGroup::kDiaphragm;
  Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();
  placement.translation() = centre_of(second) - first_centre;
  Eigen::VectorXd none(0);
  fit.minimise(outline, {}, kRobustM, placement, none);
  record("rigid", placement, still_m);

  tell("amplitudes");
  std::vector<Eigen::VectorXd> responses;
  for (const BoundaryGroup group : {BoundaryGroup::kRibCage, BoundaryGroup::kDiaphragm}) {
    if (options.directions) {
      for (Eigen::Index axis = 0; axis < 3; ++axis)
        responses.push_back(body.response(group, Vector3(Vector3::Unit(axis))));
    } else {
      const GroupMotion& motion =
          group == BoundaryGroup::kRibCage ? model.motion.rib_cage : model.motion.diaphragm;
      responses.push_back(body.response(group, motion.direction));
    }
  }
  Eigen::VectorXd factors = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(responses.size()));
  fit.minimise(std::vector<bool>(surface.nodes.size(), true), responses, kRobustM, placement, factors);
  if (options.directions) {
    const auto take = [&](GroupMotion& motion, const Vector3& moved_m) {
      motion.amplitude_m = moved_m.norm();
      if (motion.amplitude_m > 0) motion.direction = moved_m.normalized();
    };
    take(result.motion.rib_cage, factors.head<3>());
    take(result.motion.diaphragm, factors.tail<3>());
  } else {
    result.motion.rib_cage.amplitude_m = factors[0];
    result.motion.diaphragm.amplitude_m = factors[1];
  }
  const Eigen::VectorXd modelled_m = SurfaceFit::sum_of(responses, factors, still_m.size());
  record("model", placement, modelled_m);

  tell("sliding boundary");
  record("sliding boundary", placement, slide_to(model, surface, field, placement, modelled_m));
  return result;
}

LandmarkErrors errors_at(const LandmarkPairs& landmarks, const TetMesh& mesh,
                         const std::vector<ShapeFitStep>& steps) {
  LandmarkErrors errors;
  errors.of_step_m.resize(steps.size());
  for (std::size_t i = 0; i < landmarks.fixed_m.size(); ++i) {
    const LocatedPoint located = locate(mesh, landmarks.fixed_m[i]);
    if (located.outside_m > kLandmarkReachM) {
      ++errors.outside;
      continue;
    }
    errors.before_m.push_back((landmarks.fixed_m[i] - landmarks.moving_m[i]).norm());
    for (std::size_t s = 0; s < steps.size(); ++s) {
      const Vector3 placed_m =
          steps[s].placement * (landmarks.fixed_m[i] + located.point.mean(steps[s].displacement_m));
      errors.of_step_m[s].push_back((placed_m - landmarks.moving_m[i]).norm());
    }
  }
  return errors;
}

}  // namespace kiroku::sim

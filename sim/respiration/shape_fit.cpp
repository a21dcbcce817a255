#include "sim/respiration/shape_fit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/SVD>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/degrees_of_freedom.h"
#include "sim/respiration/mesh_point.h"
#include "sim/respiration/sliding_boundary.h"
#include "sim/respiration/stretch_fit.h"

namespace kiroku::sim {
namespace {

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
    moved.nodes[node] += displacement_m.segment<3>(first_row(node));
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
    return placement * (mesh_.nodes[node] + displacement_m.segment<3>(first_row(node)));
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
  /// values (Huber). Unknowns are the rigid motion and the factors of the responses. The cost that is left.
  double minimise(const std::vector<bool>& counts, const std::vector<Eigen::VectorXd>& responses,
                  double robust_m, Eigen::Isometry3d& placement, Eigen::VectorXd& factors) const {
    constexpr int kMostSteps = 100;
    constexpr double kSmallestGain = 1e-9, kMostDamping = 1e12;
    const auto unknowns = static_cast<Eigen::Index>(6 + responses.size());
    double damping = 1e-3;
    double cost = cost_of(counts, responses, robust_m, placement, factors);
    for (int step = 0; step < kMostSteps && damping < kMostDamping; ++step) {
      Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(unknowns, unknowns);
      Eigen::VectorXd right = Eigen::VectorXd::Zero(unknowns);
      const Eigen::VectorXd displacement_m = sum_of(responses, factors, first_row(mesh_.nodes.size()));
      Eigen::VectorXd row_of(unknowns);
      for (std::size_t row = 0; row < surface_.nodes.size(); ++row) {
        if (!counts[row]) continue;
        const Vector3 placed_m = place(placement, displacement_m, row);
        const SignedDistance distance = sample(second_, placed_m);
        row_of.head<3>() = distance.gradient;
        row_of.segment<3>(3) = cross_matrix(placed_m - placement * centre_m_) * distance.gradient;
        for (std::size_t i = 0; i < responses.size(); ++i) {
          row_of[static_cast<Eigen::Index>(6 + i)] = distance.gradient.dot(
              placement.linear() * responses[i].segment<3>(first_row(surface_.nodes[row])));
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
          if (done) return cost;
          break;
        }
        damping *= 10;
        if (damping >= kMostDamping) return cost;
      }
    }
    return cost;
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
    const Eigen::VectorXd displacement_m = sum_of(responses, factors, first_row(mesh_.nodes.size()));
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

/// Which of the parts that cross-validation leaves out in turn: cubes of 40 mm, as on a chessboard.
constexpr int kSurfaceParts = 4;
int surface_part(const Vector3& place_m) {
  constexpr double kCubeM = 0.04;
  const Vector3 cube = (place_m / kCubeM).array().floor();
  const auto sum = static_cast<int>(cube.x() + 2 * cube.y() + 3 * cube.z());
  return (sum % kSurfaceParts + kSurfaceParts) % kSurfaceParts;
}

/// The rigid motion in a motion: its rotation, and the same way of this place.
Eigen::Isometry3d rigid_part(const Eigen::Affine3d& motion, const Vector3& place_m) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> parts(motion.linear(), Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Isometry3d rigid = Eigen::Isometry3d::Identity();
  rigid.linear() = parts.matrixU() * parts.matrixV().transpose();
  rigid.translation() = motion * place_m - rigid.linear() * place_m;
  return rigid;
}

std::string refusal_of(const ShapeFitResult& result, std::size_t elements) {
  const ShapeFitStep& last = result.steps.back();
  std::vector<std::string> wrong;
  if (!(std::abs(last.volume_m3 / result.second_volume_m3 - 1) <= kMostVolumeError)) {
    wrong.push_back("its volume is " + number_text(1e6 * last.volume_m3, 4) + " ml and the mask's " +
                    number_text(1e6 * result.second_volume_m3, 4) + " ml (at most " +
                    number_text(100 * kMostVolumeError) + " % apart are taken)");
  }
  if (last.inverted > 0) {
    wrong.push_back(std::to_string(last.inverted) + " of its " + std::to_string(elements) +
                    " elements are inside out");
  }
  const double apart_m = last.surface_m.mean;
  if (!(apart_m <= kMostSurfaceM)) {
    wrong.push_back("its surface is " + number_text(1000 * apart_m, 3) +
                    " mm from the mask's in the mean (at most " + number_text(1000 * kMostSurfaceM) +
                    " mm are taken)");
  }
  if (wrong.empty()) return "";
  std::string text = "the lung could not be brought to the second shape: ";
  for (std::size_t i = 0; i < wrong.size(); ++i) text += (i > 0 ? ", " : "") + wrong[i];
  return text + "; look whether both are the same lungs of the same patient, whole, with the right spacing";
}

}  // namespace

ShapeFitResult fit_shape(const BreathingModel& model, const LabelMap& second, const ShapeFitOptions& options,
                         const std::function<void(const std::string&)>& step) {
  const auto tell = [&](const std::string& what) {
    if (step) step(what);
  };
  const Eigen::VectorXd still_m = Eigen::VectorXd::Zero(first_row(model.mesh.nodes.size()));
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
  if (options.poisson_ratio) {
    const MaterialProblem found = problem_of({1, *options.poisson_ratio});
    if (!found.problem.empty()) throw Error("Poisson's ratio of the sliding boundary " + found.problem);
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
  // A small lung finds many places in a large one: from where both lie, and from centres that meet.
  Eigen::Isometry3d placement = Eigen::Isometry3d::Identity(), centred = Eigen::Isometry3d::Identity();
  centred.translation() = centre_of(second) - first_centre;
  Eigen::VectorXd none(0);
  if (fit.minimise(outline, {}, kRobustM, centred, none) <
      fit.minimise(outline, {}, kRobustM, placement, none))
    placement = centred;
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
  // All that moved between the two shapes is in the amplitudes.
  for (GroupMotion* const motion : {&result.motion.rib_cage, &result.motion.diaphragm})
    motion->baseline_m = motion->drift_m_per_s = 0;
  const Eigen::VectorXd modelled_m = SurfaceFit::sum_of(responses, factors, still_m.size());
  record("model", placement, modelled_m);
  if (const std::size_t inverted = result.steps.back().inverted; inverted > 0) {
    result.warnings.push_back(
        "the model's amplitudes turn " + std::to_string(inverted) + " of " +
        std::to_string(model.mesh.tetrahedra.size()) +
        " elements inside out: this breath is too deep for its small displacements; take "
        "--displacement, not the amplitudes");
  }

  tell("even stretch");
  const SurfacePoints points = points_on(field);
  const StretchFit stretch = fit_stretch(model.mesh, surface, field, points);
  const auto back_from = [&](const Eigen::Isometry3d& there, const std::vector<Vector3>& places_m) {
    const Eigen::Isometry3d back = there.inverse();
    Eigen::VectorXd displacement_m(still_m.size());
    for (std::size_t node = 0; node < places_m.size(); ++node)
      displacement_m.segment<3>(first_row(node)) = back * places_m[node] - model.mesh.nodes[node];
    return displacement_m;
  };
  const Eigen::Isometry3d turned = rigid_part(stretch.whole, first_centre);
  record("even stretch", turned, back_from(turned, stretch.places_m));

  // What slides is the lung at rest, from the model or the stretch; with correspondences the lung as they
  // take it, in the second CT, so that its energy judges only what they leave.
  SlidingOptions sliding;
  sliding.poisson_ratio = options.poisson_ratio;
  TetMesh body_then = model.mesh;
  Eigen::Isometry3d sliding_placement = turned;
  Eigen::VectorXd start_m = result.steps.back().displacement_m;
  if (options.correspondences) {
    tell("correspondences");
    CorrespondenceFit followed =
        follow_correspondences(model.mesh, *options.correspondences, stretch.places_m);
    body_then.nodes = std::move(followed.places_m);
    sliding_placement = Eigen::Isometry3d::Identity();
    start_m = still_m;
    record("correspondences", turned, back_from(turned, body_then.nodes));
    if (const std::size_t inverted = result.steps.back().inverted; inverted > 0) {
      throw Error("the correspondences turn " + std::to_string(inverted) + " of " +
                  std::to_string(model.mesh.tetrahedra.size()) +
                  " elements inside out: they contradict each other, or the mesh is too fine for them");
    }
    result.correspondences = followed.use;
    sliding.held = std::move(followed.agreed);
  } else {
    std::vector<Vector3> modelled_places_m;
    for (std::size_t node = 0; node < model.mesh.nodes.size(); ++node)
      modelled_places_m.emplace_back(placement *
                                     (model.mesh.nodes[node] + modelled_m.segment<3>(first_row(node))));
    constexpr double kClearly = 0.8;
    if (kClearly * both_ways_m(surface, field, points, modelled_places_m) <
        both_ways_m(surface, field, points, stretch.places_m)) {
      sliding_placement = placement;
      start_m = modelled_m;
    }
  }

  tell("sliding boundary");
  const LungSurface surface_then = surface_of(body_then);
  const auto slide = [&] {
    return slide_to(body_then, model.materials, surface_then, field, points, sliding_placement, start_m,
                    sliding);
  };
  const Eigen::VectorXd slid_m = slide();
  std::vector<Vector3> slid_places_m;
  for (std::size_t node = 0; node < body_then.nodes.size(); ++node)
    slid_places_m.emplace_back(sliding_placement *
                               (body_then.nodes[node] + slid_m.segment<3>(first_row(node))));
  record("sliding boundary", turned, back_from(turned, slid_places_m));
  result.second_surface_m = spread_of(distances_to_lung_m(body_then, surface_then, points, sliding_placement,
                                                          slid_m, [](const Vector3&) { return true; }));
  result.refusal = refusal_of(result, model.mesh.tetrahedra.size());
  if (!options.cross_validate || !result.refusal.empty()) return result;

  std::vector<double> left_out_m;
  for (int part = 0; part < kSurfaceParts; ++part) {
    tell("sliding boundary without part " + std::to_string(part + 1) + " of the second surface");
    sliding.leave_out = [part](const Vector3& place_m) { return surface_part(place_m) == part; };
    const std::vector<double> there_m =
        distances_to_lung_m(body_then, surface_then, points, sliding_placement, slide(), sliding.leave_out);
    left_out_m.insert(left_out_m.end(), there_m.begin(), there_m.end());
  }
  result.left_out_m = spread_of(left_out_m);
  return result;
}

LandmarkErrors errors_at(const LandmarkPairs& landmarks, const TetMesh& mesh,
                         const std::vector<ShapeFitStep>& steps) {
  LandmarkErrors errors;
  errors.of_step_m.resize(steps.size());
  errors.vectors_of_step_m.resize(steps.size());
  const LungSurface surface = surface_of(mesh);
  const MeshLocator locator(mesh);
  for (std::size_t i = 0; i < landmarks.fixed_m.size(); ++i) {
    const Vector3& fixed_m = landmarks.fixed_m[i];
    const LocatedPoint located = locator.locate(fixed_m);
    if (located.outside_m > kLandmarkReachM) {
      ++errors.outside;
      continue;
    }
    errors.inside.fixed_m.push_back(fixed_m);
    errors.inside.moving_m.push_back(landmarks.moving_m[i]);
    errors.before_m.push_back((fixed_m - landmarks.moving_m[i]).norm());
    const auto nearest = std::ranges::min_element(
        surface.nodes, {}, [&](std::uint32_t node) { return (mesh.nodes[node] - fixed_m).squaredNorm(); });
    const auto row = static_cast<std::size_t>(nearest - surface.nodes.begin());
    errors.depth_m.push_back((mesh.nodes[*nearest] - fixed_m).norm());
    errors.normals.push_back(steps.empty() ? surface.normals[row]
                                           : Vector3(steps.back().placement.linear() * surface.normals[row]));
    for (std::size_t s = 0; s < steps.size(); ++s) {
      const Vector3 placed_m = steps[s].placement * (fixed_m + located.point.mean(steps[s].displacement_m));
      errors.vectors_of_step_m[s].push_back(placed_m - landmarks.moving_m[i]);
      errors.of_step_m[s].push_back(errors.vectors_of_step_m[s].back().norm());
    }
  }
  return errors;
}

}  // namespace kiroku::sim

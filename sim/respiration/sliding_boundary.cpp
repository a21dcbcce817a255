#include "sim/respiration/sliding_boundary.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include <Eigen/Cholesky>

#include "base/error.h"
#include "sim/fem/elimination_order.h"
#include "sim/mesh/degrees_of_freedom.h"
#include "sim/respiration/flat_elements.h"

namespace kiroku::sim {
namespace {

constexpr double kSameWayCosine = 0.3;  // of two normals, for surfaces that may be the same
constexpr double kRobustM = 0.004;      // beyond it, distances count as absolute values
constexpr double kReachM = 0.015;       // a point without a face within it has no partner

std::vector<Vector3> placed(const TetMesh& mesh, const Eigen::Isometry3d& placement,
                            const Eigen::VectorXd& displacement_m) {
  std::vector<Vector3> places = mesh.nodes;
  for (std::size_t node = 0; node < places.size(); ++node)
    places[node] = placement * (places[node] + displacement_m.segment<3>(first_row(node)));
  return places;
}

/// Where on a triangle the place nearest to p is, as weights of its corners (Ericson, "Real-Time Collision
/// Detection", 2005, 5.1.5).
std::array<double, 3> nearest_on(const Vector3& p, const Vector3& a, const Vector3& b, const Vector3& c) {
  const Vector3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp),
               d6 = ac.dot(cp);
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return {1 - d1 / (d1 - d3), d1 / (d1 - d3), 0};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return {1 - d2 / (d2 - d6), 0, d2 / (d2 - d6)};
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - w, w};
  }
  const double sum = va + vb + vc;
  return {va / sum, vb / sum, vc / sum};
}

/// The lung's surface as it lies: for a point of the second one, the nearest place of it that looks the same
/// way.
class PlacedSurface {
 public:
  PlacedSurface(const LungSurface& surface, const std::vector<Vector3>& places_m)
      : surface_(surface),
        places_m_(places_m),
        normals_(normals_at(surface, places_m)),
        faces_of_(surface.nodes.size()) {
    for (std::uint32_t face = 0; face < surface.faces.size(); ++face) {
      for (const std::uint32_t row : surface.faces[face]) faces_of_[row].push_back(face);
    }
  }

  struct Partner {
    std::size_t face = 0;
    std::array<double, 3> weights{};
    double along_m = 0;  // from the point to there, along its normal
  };
  [[nodiscard]] std::optional<Partner> partner(const Vector3& point_m, const Vector3& normal) const {
    std::optional<std::size_t> nearest;
    double least = kReachM * kReachM;
    for (std::size_t row = 0; row < surface_.nodes.size(); ++row) {
      const double square = (place_m(row) - point_m).squaredNorm();
      if (square >= least || normals_[row].dot(normal) < kSameWayCosine) continue;
      least = square;
      nearest = row;
    }
    if (!nearest) return std::nullopt;
    Partner best;
    least = std::numeric_limits<double>::infinity();
    for (const std::uint32_t face : faces_of_[*nearest]) {
      const auto& rows = surface_.faces[face];
      const auto weights = nearest_on(point_m, place_m(rows[0]), place_m(rows[1]), place_m(rows[2]));
      const Vector3 there_m =
          weights[0] * place_m(rows[0]) + weights[1] * place_m(rows[1]) + weights[2] * place_m(rows[2]);
      if (const double square = (there_m - point_m).squaredNorm(); square < least) {
        least = square;
        best = {face, weights, normal.dot(there_m - point_m)};
      }
    }
    return best;
  }

  [[nodiscard]] double nearest_node_m(const Vector3& point_m) const {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t row = 0; row < surface_.nodes.size(); ++row)
      least = std::min(least, (place_m(row) - point_m).squaredNorm());
    return std::sqrt(least);
  }

 private:
  [[nodiscard]] const Vector3& place_m(std::size_t row) const { return places_m_[surface_.nodes[row]]; }

  const LungSurface& surface_;
  const std::vector<Vector3>& places_m_;
  std::vector<Vector3> normals_;
  std::vector<std::vector<std::uint32_t>> faces_of_;
};

/// A spring along one direction at a place of an element: stiffness/2 (direction . sum w_i u_i - wanted)^2.
struct Spring {
  std::uint32_t tetrahedron = 0;
  Eigen::Vector4d weights = Eigen::Vector4d::Zero();  // of its corners
  Vector3 direction = Vector3::Zero();
  double wanted_m = 0, stiffness_n_m = 0;
};

double robust(double distance_m) { return std::min(1.0, kRobustM / std::max(std::abs(distance_m), 1e-12)); }

/// The energy of one mesh, and its least under springs.
class EvenlyStretched {
 public:
  EvenlyStretched(const TetMesh& mesh, const Materials& materials, std::optional<double> poisson_ratio)
      : mesh_(mesh),
        materials_(materials),
        order_(elimination_order(mesh)),
        free_(3 * mesh.nodes.size(), false),
        stiffening_(mesh.tetrahedra.size(), 1) {
    double moduli = 0, volume_m3 = 0;
    if (poisson_ratio) {
      for (auto& [region, material] : materials_) material.poisson_ratio = *poisson_ratio;
    }
    for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
      for (const std::uint32_t node : mesh.tetrahedra[t])
        std::fill_n(free_.begin() + static_cast<std::ptrdiff_t>(first_row(node)), 3, true);
      const double element_m3 = signed_volume_m3(mesh, t);
      volume_m3 += element_m3;
      moduli += element_m3 * materials_.at(mesh.regions[t]).young_modulus_pa;
    }
    young_modulus_pa_ = moduli / volume_m3;
    find_stretches();
  }
  [[nodiscard]] double young_modulus_pa() const { return young_modulus_pa_; }

  /// With the even stretch that leaves least energy.
  [[nodiscard]] Eigen::VectorXd solve(const std::vector<Spring>& springs) const {
    Eigen::VectorXd pull_n;
    const StiffnessMatrix held = matrix_of(springs, pull_n);
    const Factorisation factor(held, free_, order_);
    // Without the stretches' own energy: the factor's solution, corrected in six directions (Woodbury).
    Eigen::MatrixXd columns(pull_n.size(), 7);
    columns.leftCols<6>() = stretch_forces_n_;
    columns.col(6) = pull_n;
    factor.solve_columns(columns);
    const Eigen::Matrix<double, 6, 6> left =
        stretch_energies_ - stretch_forces_n_.transpose() * columns.leftCols<6>();
    return columns.col(6) +
           columns.leftCols<6>() * left.ldlt().solve(stretch_forces_n_.transpose() * columns.col(6));
  }

  /// With the energy of what goes beyond `rest_m`.
  [[nodiscard]] Eigen::VectorXd solve_from(const Eigen::VectorXd& rest_m,
                                           const std::vector<Spring>& springs) const {
    Eigen::VectorXd pull_n;
    const StiffnessMatrix held = matrix_of(springs, pull_n);
    const Factorisation factor(held, free_, order_);
    // In u - rest: what each spring still wants there.
    for (const Spring& spring : springs) {
      double there_m = 0;
      for (std::size_t i = 0; i < 4; ++i) {
        there_m +=
            spring.weights[static_cast<Eigen::Index>(i)] *
            spring.direction.dot(rest_m.segment<3>(first_row(mesh_.tetrahedra[spring.tetrahedron][i])));
      }
      add_pull(spring, -there_m, pull_n);
    }
    return rest_m + factor.solve(pull_n);
  }

  /// The even stretch that is nearest in energy, but for a rigid motion.
  [[nodiscard]] Eigen::VectorXd even_part(const Eigen::VectorXd& displacement_m) const {
    return stretches_ * stretch_energies_.ldlt().solve(stretch_forces_n_.transpose() * displacement_m);
  }

  /// Stiffens the elements that are flat or inside out when the body is displaced so; whether there are any.
  bool stiffen_flat_ones(const Eigen::VectorXd& displacement_m) {
    std::vector<Vector3> places_m = mesh_.nodes;
    for (std::size_t node = 0; node < places_m.size(); ++node)
      places_m[node] += displacement_m.segment<3>(first_row(node));
    return stiffen_flat_elements(mesh_, places_m, stiffening_);
  }

 private:
  [[nodiscard]] Eigen::Matrix<double, 12, 12> element_matrix(std::size_t t) const {
    const LinearElement element = element_of(mesh_, t);
    const Material& material = materials_.at(mesh_.regions[t]);
    Eigen::Matrix<double, 12, 12> matrix;
    for (Eigen::Index a = 0; a < 4; ++a) {
      for (Eigen::Index b = 0; b < 4; ++b)
        matrix.block<3, 3>(3 * a, 3 * b) = stiffening_[t] * stiffness_block(element, material, a, b);
    }
    return matrix;
  }

  void add_pull(const Spring& spring, double wanted_m, Eigen::VectorXd& pull_n) const {
    for (std::size_t i = 0; i < 4; ++i) {
      pull_n.segment<3>(first_row(mesh_.tetrahedra[spring.tetrahedron][i])) +=
          spring.stiffness_n_m * wanted_m * spring.weights[static_cast<Eigen::Index>(i)] * spring.direction;
    }
  }

  /// Of the elements with the springs; and the springs' pulls.
  [[nodiscard]] StiffnessMatrix matrix_of(const std::vector<Spring>& springs, Eigen::VectorXd& pull_n) const {
    std::vector<std::vector<const Spring*>> of_tetrahedron(mesh_.tetrahedra.size());
    pull_n = Eigen::VectorXd::Zero(first_row(mesh_.nodes.size()));
    for (const Spring& spring : springs) {
      of_tetrahedron[spring.tetrahedron].push_back(&spring);
      add_pull(spring, spring.wanted_m, pull_n);
    }
    return StiffnessMatrix(mesh_, [&](std::size_t t) {
      Eigen::Matrix<double, 12, 12> matrix = element_matrix(t);
      for (const Spring* spring : of_tetrahedron[t]) {
        const Eigen::Matrix<double, 12, 1> row = row_of(*spring);
        matrix += spring->stiffness_n_m * row * row.transpose();
      }
      return matrix;
    });
  }

  static Eigen::Matrix<double, 12, 1> row_of(const Spring& spring) {
    Eigen::Matrix<double, 12, 1> row;
    for (Eigen::Index i = 0; i < 4; ++i) row.segment<3>(3 * i) = spring.weights[i] * spring.direction;
    return row;
  }

  /// Even strains of 1 along and between the axes, and the forces that they take.
  void find_stretches() {
    constexpr std::array<std::array<Eigen::Index, 2>, 6> kAxes{
        {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {1, 2}, {2, 0}}};
    stretches_.setZero(first_row(mesh_.nodes.size()), 6);
    for (std::size_t node = 0; node < mesh_.nodes.size(); ++node) {
      for (std::size_t i = 0; i < 6; ++i) {
        const auto [to, along] = kAxes[i];
        stretches_(first_row(node) + to, static_cast<Eigen::Index>(i)) += mesh_.nodes[node][along];
        if (to != along)
          stretches_(first_row(node) + along, static_cast<Eigen::Index>(i)) += mesh_.nodes[node][to];
      }
    }
    const StiffnessMatrix loose(mesh_, [this](std::size_t t) { return element_matrix(t); });
    stretch_forces_n_.resize(stretches_.rows(), 6);
    for (Eigen::Index i = 0; i < 6; ++i)
      stretch_forces_n_.col(i) = loose * Eigen::VectorXd(stretches_.col(i));
    stretch_energies_ = stretches_.transpose() * stretch_forces_n_;
  }

  const TetMesh& mesh_;
  Materials materials_;
  std::vector<std::uint32_t> order_;
  std::vector<bool> free_;
  std::vector<double> stiffening_;  // (|T|), factors
  double young_modulus_pa_ = 0;
  Eigen::Matrix<double, Eigen::Dynamic, 6> stretches_, stretch_forces_n_;  // (3 |V| x 6), m and N
  Eigen::Matrix<double, 6, 6> stretch_energies_;
};

/// Where springs hang: a tetrahedron of each node of the surface, and of each of its faces.
struct Anchors {
  std::vector<std::uint32_t> of_row, of_face;
};

Anchors anchors_of(const TetMesh& mesh, const LungSurface& surface) {
  Anchors anchors{std::vector<std::uint32_t>(surface.nodes.size()), {}};
  // surface_of() keeps the order of these faces.
  for (const Face& face : faces_of(mesh).surface) {
    anchors.of_face.push_back(face.tetrahedron);
    for (const std::uint32_t node : face.nodes)
      anchors.of_row[static_cast<std::size_t>(surface.row_of[node])] = face.tetrahedron;
  }
  return anchors;
}

/// Weights of some of an element's corners, by its corners.
template <std::size_t count>
Eigen::Vector4d corner_weights(const TetMesh& mesh, std::uint32_t tetrahedron,
                               const std::array<std::uint32_t, count>& nodes,
                               const std::array<double, count>& weights) {
  Eigen::Vector4d all = Eigen::Vector4d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    const auto& corners = mesh.tetrahedra[tetrahedron];
    all[std::ranges::find(corners, nodes[i]) - corners.begin()] += weights[i];
  }
  return all;
}

/// What the second surface asks of a lung that lies at `displacement_m`.
std::vector<Spring> springs_at(const TetMesh& mesh, const LungSurface& surface, const Anchors& anchors,
                               const DistanceField& second, const SurfacePoints& points,
                               const Eigen::Isometry3d& placement, const Eigen::VectorXd& displacement_m,
                               double stiffness_n_m3, const SlidingOptions& options) {
  std::vector<Spring> springs;
  const Eigen::Matrix3d back = placement.linear().transpose();
  const std::vector<Vector3> places = placed(mesh, placement, displacement_m);
  double area_m2 = 0;
  for (std::size_t row = 0; row < surface.nodes.size(); ++row) {
    const std::uint32_t node = surface.nodes[row];
    area_m2 += surface.areas_m2[row];
    const SignedDistance found = sample(second, places[node]);
    const Vector3 normal = found.gradient.normalized();
    // On a ridge of the distances there is no one way to the surface.
    constexpr double kLeastSlope = 0.3;
    if (found.gradient.norm() < kLeastSlope) continue;
    if (options.leave_out && options.leave_out(places[node] - found.distance_m * normal)) continue;
    const Vector3 direction = back * normal;
    springs.push_back({anchors.of_row[row], corner_weights<1>(mesh, anchors.of_row[row], {node}, {1}),
                       direction,
                       direction.dot(displacement_m.segment<3>(first_row(node))) - found.distance_m,
                       stiffness_n_m3 * surface.areas_m2[row] * robust(found.distance_m)});
  }
  const PlacedSurface lung(surface, places);
  const double each_m2 = area_m2 / static_cast<double>(points.places_m.size());
  for (std::size_t i = 0; i < points.places_m.size(); ++i) {
    if (options.leave_out && options.leave_out(points.places_m[i])) continue;
    const auto partner = lung.partner(points.places_m[i], points.normals[i]);
    if (!partner) continue;
    std::array<std::uint32_t, 3> nodes{};
    for (std::size_t corner = 0; corner < 3; ++corner)
      nodes[corner] = surface.nodes[surface.faces[partner->face][corner]];
    Spring spring{anchors.of_face[partner->face],
                  corner_weights(mesh, anchors.of_face[partner->face], nodes, partner->weights),
                  back * points.normals[i], -partner->along_m,
                  stiffness_n_m3 * each_m2 * robust(partner->along_m)};
    for (std::size_t corner = 0; corner < 3; ++corner) {
      spring.wanted_m += partner->weights[corner] *
                         spring.direction.dot(displacement_m.segment<3>(first_row(nodes[corner])));
    }
    springs.push_back(spring);
  }
  return springs;
}

/// What keeps points of the inside where `start_m` takes them.
void hold_points(const std::vector<LocatedPoint>& held, const Eigen::VectorXd& start_m, double stiffness_n_m,
                 std::vector<Spring>& springs) {
  for (const LocatedPoint& point : held) {
    const Vector3 there_m = point.point.mean(start_m);
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      springs.push_back({point.tetrahedron, Eigen::Vector4d(point.point.weights.data()), Vector3::Unit(axis),
                         there_m[axis], stiffness_n_m});
    }
  }
}

}  // namespace

SurfacePoints points_on(const DistanceField& field) {
  constexpr double kApartM = 0.004;
  constexpr int kProjections = 4;
  constexpr double kOnSurfaceM = 0.0005;
  const double near_m = field.grid.spacing_m.maxCoeff();
  std::map<std::array<long, 3>, std::size_t> taken;
  SurfacePoints points;
  for (std::size_t k = 0; k < field.grid.size[2]; ++k) {
    for (std::size_t j = 0; j < field.grid.size[1]; ++j) {
      for (std::size_t i = 0; i < field.grid.size[0]; ++i) {
        if (std::abs(static_cast<double>(field.distance_m[field.grid.offset(i, j, k)])) > near_m) continue;
        Vector3 place_m = field.grid.patient_m(
            Vector3(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)));
        SignedDistance found = sample(field, place_m);
        for (int step = 0; step < kProjections && found.gradient.norm() > 0; ++step) {
          place_m -= found.distance_m * found.gradient.normalized();
          found = sample(field, place_m);
        }
        if (std::abs(found.distance_m) > kOnSurfaceM || !(found.gradient.norm() > 0)) continue;
        const Vector3 cell = (place_m / kApartM).array().floor();
        if (!taken
                 .try_emplace({std::lround(cell.x()), std::lround(cell.y()), std::lround(cell.z())},
                              points.places_m.size())
                 .second)
          continue;
        points.places_m.push_back(place_m);
        points.normals.push_back(found.gradient.normalized());
      }
    }
  }
  return points;
}

Eigen::VectorXd slide_to(const TetMesh& mesh, const Materials& materials, const LungSurface& surface,
                         const DistanceField& second, const SurfacePoints& points,
                         const Eigen::Isometry3d& placement, const Eigen::VectorXd& start_m,
                         const SlidingOptions& options) {
  if (points.places_m.empty()) throw Error("the second shape has no surface to slide along");
  // From so soft that the lung is all but stretched and turned as a whole.
  constexpr std::array<double, 4> kYields{500, 50, 5, 1};
  constexpr int kStepsEach = 3, kMostStiffenings = 12;
  // A point holds as much as a ball of tissue of this size around it does.
  constexpr double kHeldM = 0.03;
  EvenlyStretched body(mesh, materials, options.poisson_ratio);
  const Anchors anchors = anchors_of(mesh, surface);
  Eigen::VectorXd displacement_m = start_m;
  const auto springs = [&](double yield) {
    std::vector<Spring> all = springs_at(mesh, surface, anchors, second, points, placement, displacement_m,
                                         body.young_modulus_pa() / (yield * options.yield_m), options);
    hold_points(options.held, start_m, body.young_modulus_pa() * kHeldM, all);
    return all;
  };
  for (const double yield : kYields) {
    for (int step = 0; step < kStepsEach; ++step) {
      displacement_m =
          options.held.empty() ? body.solve(springs(yield)) : body.solve_from(start_m, springs(yield));
    }
  }
  const Eigen::VectorXd rest_m = options.held.empty() ? body.even_part(displacement_m) : start_m;
  for (int round = 0; round < kMostStiffenings && body.stiffen_flat_ones(displacement_m); ++round)
    displacement_m = body.solve_from(rest_m, springs(kYields.back()));
  return displacement_m;
}

std::vector<double> distances_to_lung_m(const TetMesh& mesh, const LungSurface& surface,
                                        const SurfacePoints& points, const Eigen::Isometry3d& placement,
                                        const Eigen::VectorXd& displacement_m,
                                        const std::function<bool(const Vector3&)>& counts) {
  const std::vector<Vector3> places = placed(mesh, placement, displacement_m);
  const PlacedSurface lung(surface, places);
  std::vector<double> distances;
  for (std::size_t i = 0; i < points.places_m.size(); ++i) {
    if (!counts(points.places_m[i])) continue;
    const auto partner = lung.partner(points.places_m[i], points.normals[i]);
    distances.push_back(partner ? std::abs(partner->along_m) : lung.nearest_node_m(points.places_m[i]));
  }
  return distances;
}

}  // namespace kiroku::sim

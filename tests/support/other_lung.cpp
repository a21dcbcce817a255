#include "tests/support/other_lung.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <thread>

#include "base/error.h"
#include "base/parallel.h"
#include "sim/fem/corotational_body.h"
#include "sim/mesh/degrees_of_freedom.h"

namespace kiroku::test {
namespace {

using sim::BoundaryGroup;
using sim::Vector3;

/// What a wall's node is pushed back with, N/m: some ten times what a lung of 10 kPa resists over the 6 mm
/// between nodes.
constexpr double kWallNPerM = 600;

/// The lung between its walls.
class WalledLung {
 public:
  explicit WalledLung(const sim::BreathingModel& model)
      : model_(model),
        materials_(other(model.materials)),
        body_(model.mesh, materials_, held(model)),
        normals_(model.mesh.nodes.size(), Vector3::Zero()),
        owner_(model.mesh.nodes.size(), 0) {
    const sim::LungSurface surface = sim::surface_of(model.mesh);
    for (std::size_t node = 0; node < model.groups.size(); ++node) {
      const BoundaryGroup group = model.groups[node];
      if (group == BoundaryGroup::kRibCage || group == BoundaryGroup::kDiaphragm ||
          group == BoundaryGroup::kBack)
        normals_[node] = surface.normals[static_cast<std::size_t>(surface.row_of[node])];
    }
    for (std::size_t t = 0; t < model.mesh.tetrahedra.size(); ++t) {
      elements_.push_back(sim::element_of(model.mesh, t));
      for (const std::uint32_t corner : model.mesh.tetrahedra[t]) owner_[corner] = t;
    }
  }

  /// From `at_m` (3 |V|) to equilibrium, by Newton's method on the convex curvature: until a step promises
  /// less than kLeastGain of the energy, or there is none to be had (where an element is flat the energy has
  /// a kink) and it promised little.
  [[nodiscard]] Eigen::VectorXd solve(double rib_cage_m, double diaphragm_m, Eigen::VectorXd at_m) const {
    const std::vector<double> wall_m = walls(rib_cage_m, diaphragm_m);
    constexpr int kMostSteps = 40;
    constexpr double kLeastGain = 1e-4, kLittle = 1e-2, kSmallestPart = 1.0 / 1024;
    for (int step = 0; step < kMostSteps; ++step) {
      Eigen::VectorXd left_n = -body_.inner_force_n(at_m);
      for (std::size_t node = 0; node < normals_.size(); ++node)
        left_n.segment<3>(sim::first_row(node)) -= kWallNPerM * gap(node, at_m, wall_m) * normals_[node];
      for (std::size_t i = 0; i < body_.linear().free().size(); ++i) {
        if (!body_.linear().free()[i]) left_n[static_cast<Eigen::Index>(i)] = 0;
      }
      const sim::StiffnessMatrix stiffness(model_.mesh, [&](std::size_t t) { return element(t, at_m); });
      const Eigen::VectorXd newton_m =
          sim::Factorisation(stiffness, body_.linear().free(), body_.linear().order(), 1).solve(left_n);
      const double energy = energy_j(at_m, wall_m), promised = left_n.dot(newton_m) / 2;
      if (promised <= kLeastGain * energy) return at_m;
      const Eigen::VectorXd from_m = at_m;
      double part = 1;
      at_m = from_m + newton_m;
      while (part > kSmallestPart && !(energy_j(at_m, wall_m) <= energy)) {
        part /= 2;
        at_m = from_m + part * newton_m;
      }
      if (part <= kSmallestPart) {
        if (promised <= kLittle * energy) return from_m;
        break;
      }
    }
    throw Error("the other lung finds no equilibrium between its walls: lessen its motion");
  }

 private:
  static sim::Materials other(sim::Materials materials) {
    for (auto& [region, material] : materials) material.poisson_ratio = kOtherPoissonRatio;
    return materials;
  }
  static sim::Constraints held(const sim::BreathingModel& model) {
    sim::Constraints constraints(model.mesh.nodes.size());
    for (std::size_t node = 0; node < model.groups.size(); ++node) {
      if (model.groups[node] == BoundaryGroup::kTrachea)
        constraints.prescribe(node, Vector3::Zero(), "hilum");
    }
    return constraints;
  }

  /// Along the normals, (|V|).
  [[nodiscard]] std::vector<double> walls(double rib_cage_m, double diaphragm_m) const {
    const sim::Extent extent = sim::extent_of(model_.mesh);
    std::vector<double> wall_m(normals_.size(), 0);
    for (std::size_t node = 0; node < normals_.size(); ++node) {
      const double back =
          (model_.mesh.nodes[node].y() - extent.least.y()) / (extent.greatest.y() - extent.least.y());
      if (model_.groups[node] == BoundaryGroup::kRibCage) wall_m[node] = rib_cage_m;
      if (model_.groups[node] == BoundaryGroup::kDiaphragm)
        wall_m[node] = diaphragm_m * (0.7 + 0.6 * back) * -normals_[node].z();
    }
    return wall_m;
  }
  [[nodiscard]] double gap(std::size_t node, const Eigen::VectorXd& at_m,
                           const std::vector<double>& wall_m) const {
    return normals_[node].dot(at_m.segment<3>(sim::first_row(node))) - wall_m[node];
  }
  [[nodiscard]] double energy_j(const Eigen::VectorXd& at_m, const std::vector<double>& wall_m) const {
    double energy = body_.energy_j(at_m);
    for (std::size_t node = 0; node < normals_.size(); ++node) {
      if (normals_[node].squaredNorm() > 0) energy += kWallNPerM / 2 * std::pow(gap(node, at_m, wall_m), 2);
    }
    return energy;
  }
  /// The corotational element's, and the springs of the nodes that are this element's to count.
  [[nodiscard]] sim::ElementMatrix element(std::size_t t, const Eigen::VectorXd& at_m) const {
    const sim::Tetrahedron& corners = model_.mesh.tetrahedra[t];
    Eigen::Matrix<double, 4, 3> rows;
    for (Eigen::Index a = 0; a < 4; ++a)
      rows.row(a) = at_m.segment<3>(sim::first_row(corners[static_cast<std::size_t>(a)])).transpose();
    sim::ElementMatrix matrix = sim::corotational_stiffness(
        elements_[t], materials_.at(model_.mesh.regions[t]),
        sim::principal_stretches(sim::deformation_gradient(elements_[t], rows)), sim::Curvature::kConvex);
    for (Eigen::Index a = 0; a < 4; ++a) {
      const std::uint32_t node = corners[static_cast<std::size_t>(a)];
      if (owner_[node] == t)
        matrix.block<3, 3>(3 * a, 3 * a) += kWallNPerM * normals_[node] * normals_[node].transpose();
    }
    return matrix;
  }

  const sim::BreathingModel& model_;
  sim::Materials materials_;
  sim::CorotationalBody body_;
  std::vector<Vector3> normals_;  // (|V|), of walls; zero for all others
  std::vector<std::size_t> owner_;
  std::vector<sim::LinearElement> elements_;
};

}  // namespace

double Chance::even() { return (double(engine_()) + 0.5) / 4294967296.0; }

double Chance::normal() {
  const double radius = std::sqrt(-2 * std::log(even()));
  return radius * std::cos(2 * std::numbers::pi * even());
}

double Chance::poisson(double mean) {
  constexpr double kMany = 60;
  if (mean > kMany) return std::max(std::round(mean + std::sqrt(mean) * normal()), 0.0);
  double product = even(), count = 0;
  for (const double least = std::exp(-mean); product > least; ++count) product *= even();
  return count;
}

IrregularBreaths::IrregularBreaths(double until_s, double length_s, Chance& chance) {
  constexpr double kAroundS = 10;
  for (double begin_s = -kAroundS; begin_s < until_s + kAroundS;) {
    const double own_s = length_s * std::clamp(1 + 0.2 * chance.normal(), 0.6, 1.5);
    breaths_.push_back({begin_s, own_s, std::clamp(1 + 0.2 * chance.normal(), 0.5, 1.5)});
    begin_s += own_s;
  }
}

double IrregularBreaths::at(double time_s) const {
  const Breath* at = &breaths_.front();
  for (const Breath& breath : breaths_) {
    if (breath.begin_s <= time_s) at = &breath;
  }
  return at->depth * (1 - std::pow(std::cos(std::numbers::pi * (time_s - at->begin_s) / at->length_s), 4));
}

OtherLung::OtherLung(const sim::BreathingModel& model, IrregularBreaths breaths, const OtherMotion& motion)
    : breaths_(std::move(breaths)), motion_(motion) {
  const sim::Extent extent = sim::extent_of(model.mesh);
  for (const Vector3& node : model.mesh.nodes)
    height_.push_back((node.z() - extent.least.z()) / (extent.greatest.z() - extent.least.z()));
  // Depths go up to 1.5; a drift of some minutes.
  constexpr double kDeepest = 1.5, kDriftS = 60;
  rib_cage_ = sim::StateAxis::covering(motion.rib_cage_rest_m,
                                       motion.rib_cage_rest_m + kDeepest * motion.rib_cage_depth_m, 0.004);
  diaphragm_ = sim::StateAxis::covering(
      motion.diaphragm_rest_m,
      motion.diaphragm_rest_m + kDeepest * motion.diaphragm_depth_m + kDriftS * motion.drift_m_per_s, 0.005);
  states_.resize(rib_cage_.count * diaphragm_.count);
  for_each_part(rib_cage_.count, std::max(std::thread::hardware_concurrency(), 1U), [&](std::size_t i) {
    const WalledLung lung(model);
    const auto solve = [&](std::size_t j, const Eigen::VectorXd& from_m) {
      const Eigen::VectorXd at_m = lung.solve(rib_cage_.node(i), diaphragm_.node(j), from_m);
      std::vector<Vector3>& state = states_[i * diaphragm_.count + j];
      for (Eigen::Index row = 0; row < at_m.size(); row += 3) state.emplace_back(at_m.segment<3>(row));
      return at_m;
    };
    // From where the walls have hardly moved, up and down.
    std::size_t middle = 0;
    while (middle + 1 < diaphragm_.count && diaphragm_.node(middle) < 0) ++middle;
    const Eigen::VectorXd first_m =
        solve(middle, Eigen::VectorXd::Zero(sim::first_row(model.mesh.nodes.size())));
    Eigen::VectorXd at_m = first_m;
    for (std::size_t j = middle + 1; j < diaphragm_.count; ++j) at_m = solve(j, at_m);
    at_m = first_m;
    for (std::size_t j = middle; j-- > 0;) at_m = solve(j, at_m);
  });
}

std::vector<Vector3> OtherLung::displacement_m(double time_s) const {
  const sim::StateAxis::Blend r = rib_cage_.at(
      motion_.rib_cage_rest_m + motion_.rib_cage_depth_m * breaths_.at(time_s + motion_.rib_cage_leads_s));
  std::vector<Vector3> displacement_m(height_.size(), Vector3::Zero());
  for (std::size_t node = 0; node < height_.size(); ++node) {
    const double follows_s = motion_.top_follows_s * height_[node];
    const sim::StateAxis::Blend d =
        diaphragm_.at(motion_.diaphragm_rest_m + motion_.diaphragm_depth_m * breaths_.at(time_s - follows_s) +
                      motion_.drift_m_per_s * time_s);
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < 4; ++j) {
        displacement_m[node] +=
            r.weight[i] * d.weight[j] * states_[(r.first + i) * diaphragm_.count + d.first + j][node];
      }
    }
  }
  return displacement_m;
}

}  // namespace kiroku::test

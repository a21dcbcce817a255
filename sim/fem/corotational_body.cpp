#include "sim/fem/corotational_body.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::sim {
namespace {

constexpr double kLargestResidual = 1e-9;  // of the largest force at a node
/// Of the force that a strain of 1 makes: what rounding leaves of a body that is only turned.
constexpr double kStrainRounding = 1e-13;
constexpr int kMostIterations = 50;
constexpr double kSmallestStep = 1.0 / 256;  // of the load
constexpr int kMostHalvings = 33;            // of Newton's step
constexpr double kArmijo = 1e-4;

}  // namespace

/// One solve.
class CorotationalBody::Search {
 public:
  Search(const CorotationalBody& body, const Eigen::VectorXd& force_n)
      : body_(body),
        linear_(body.linear_),
        force_n_(force_n),
        displacement_m_(Eigen::VectorXd::Zero(force_n.size())) {}

  Solution run() {
    double reached = 0;  // of the load
    for (double step = 1; reached < 1;) {
      const double next = std::min(1.0, reached + step);
      const Eigen::VectorXd before_m = displacement_m_;
      if (converge(reached, next)) {
        reached = next;
        step *= 2;
        continue;
      }
      displacement_m_ = before_m;
      step /= 2;
      if (step < kSmallestStep) {
        throw Error("no equilibrium is found beyond " + number_text(100 * reached, 2) +
                    " % of the load: under more it buckles or is crushed; lessen forces and displacements");
      }
    }
    Solution solution;
    solution.displacement_m = displacement_m_;
    solution.factorisations = factorisations_;
    solution.reaction_force_n = Eigen::VectorXd::Zero(force_n_.size());
    const Eigen::VectorXd inner_n = body_.inner_force_n(displacement_m_);
    for (Eigen::Index i = 0; i < force_n_.size(); ++i) {
      if (linear_.constraints().prescribed(static_cast<std::size_t>(i)))
        solution.reaction_force_n[i] = inner_n[i] - force_n_[i];
    }
    return solution;
  }

 private:
  [[nodiscard]] double energy_j(const Eigen::VectorXd& displacement_m, double load) const {
    return body_.energy_j(displacement_m) - load * force_n_.dot(displacement_m);
  }

  /// How all nodes move when what is prescribed moves by `prescribed_m`, (3 |V|), under forces out of
  /// balance. The exact curvature converges fast; where it has no minimum, the convex one goes downhill.
  std::optional<Eigen::VectorXd> newton_step(const Eigen::VectorXd& unbalanced_n,
                                             const Eigen::VectorXd& prescribed_m) {
    for (const Curvature curvature : {Curvature::kExact, Curvature::kConvex}) {
      try {
        const StiffnessMatrix stiffness = body_.stiffness(displacement_m_, curvature);
        ++factorisations_;
        Eigen::VectorXd step_m = prescribed_m + Factorisation(stiffness, linear_.free(), linear_.order())
                                                    .solve(unbalanced_n - stiffness * prescribed_m);
        if (step_m.allFinite()) return step_m;
      } catch (const Error&) {
        // Not positive definite: no minimum near here, or not even downhill.
      }
    }
    return std::nullopt;
  }

  /// From equilibrium under `before` of the load to that under `load`; false where there is none to be found.
  bool converge(double before, double load) {
    const Eigen::VectorXd prescribed_m = (load - before) * linear_.constraints().displacement_m();
    if (before == 0) {
      // At rest the tangent is the linear body's.
      displacement_m_ = load * linear_.solve(force_n_).displacement_m;
    } else {
      const auto step_m = newton_step(unbalanced_n(load), prescribed_m);
      if (!step_m) return false;
      displacement_m_ += *step_m;
    }
    const Eigen::VectorXd still_m = Eigen::VectorXd::Zero(force_n_.size());
    Eigen::VectorXd left_n = unbalanced_n(load);
    for (int i = 0; i < kMostIterations && left_n.allFinite(); ++i) {
      if (left_n.cwiseAbs().maxCoeff() <= tolerance_n(load)) return !body_.any_inverted(displacement_m_);
      const auto step_m = newton_step(left_n, still_m);
      if (!step_m || !descend(*step_m, load, left_n)) return false;
    }
    return false;
  }

  /// What is left of loads and inner forces where nothing holds; (3 |V|).
  [[nodiscard]] Eigen::VectorXd unbalanced_n(double load) {
    const Eigen::VectorXd inner_n = body_.inner_force_n(displacement_m_);
    largest_inner_n_ = inner_n.cwiseAbs().maxCoeff();
    Eigen::VectorXd left_n = load * force_n_ - inner_n;
    for (Eigen::Index i = 0; i < left_n.size(); ++i) {
      if (!linear_.free()[static_cast<std::size_t>(i)]) left_n[i] = 0;
    }
    return left_n;
  }

  [[nodiscard]] double tolerance_n(double load) const {
    return body_.tolerance_n(std::max(largest_inner_n_, load * force_n_.cwiseAbs().maxCoeff()));
  }

  /// Along Newton's step until there is less energy by enough, or half of the forces out of balance: near
  /// the minimum differences of energy are lost in rounding. `left_n` becomes what is there.
  bool descend(const Eigen::VectorXd& step_m, double load, Eigen::VectorXd& left_n) {
    const Eigen::VectorXd from_m = displacement_m_;
    const double energy = energy_j(from_m, load), slope_j = left_n.dot(step_m), before_n = left_n.norm();
    double part = 1;
    for (int halved = 0; halved < kMostHalvings; ++halved, part /= 2) {
      displacement_m_ = from_m + part * step_m;
      left_n = unbalanced_n(load);
      if (left_n.norm() <= before_n / 2 ||
          energy_j(displacement_m_, load) <= energy - kArmijo * part * slope_j) {
        return true;
      }
    }
    return false;
  }

  const CorotationalBody& body_;
  const ElasticBody& linear_;
  const Eigen::VectorXd& force_n_;
  Eigen::VectorXd displacement_m_;
  double largest_inner_n_ = 0;
  int factorisations_ = 0;
};

CorotationalBody::CorotationalBody(TetMesh mesh, const Materials& materials, Constraints constraints)
    : linear_(std::move(mesh), materials, std::move(constraints)) {
  if (linear_.constraints().turned())
    throw Error("nodes with axes of their own are for small displacements: prescribe along x, y and z here");
  elements_.reserve(linear_.mesh().tetrahedra.size());
  for (std::size_t t = 0; t < linear_.mesh().tetrahedra.size(); ++t) {
    const LinearElement& element = elements_.emplace_back(element_of(linear_.mesh(), t));
    rounding_n_ =
        std::max(rounding_n_, kStrainRounding * linear_.material_of(t).young_modulus_pa * element.volume_m3 *
                                  element.gradients.rowwise().norm().maxCoeff());
  }
}

CorotationalBody::Solution CorotationalBody::solve(const Eigen::VectorXd& force_n) const {
  return Search(*this, force_n).run();
}

PrincipalStretches CorotationalBody::stretches(std::size_t t, const Eigen::VectorXd& displacement_m) const {
  Eigen::Matrix<double, 4, 3> rows;
  for (std::size_t a = 0; a < 4; ++a) {
    const auto node = static_cast<Eigen::Index>(3 * std::size_t{linear_.mesh().tetrahedra[t][a]});
    rows.row(static_cast<Eigen::Index>(a)) = displacement_m.segment<3>(node).transpose();
  }
  return principal_stretches(deformation_gradient(elements_[t], rows));
}

Eigen::VectorXd CorotationalBody::inner_force_n(const Eigen::VectorXd& displacement_m) const {
  Eigen::VectorXd force_n = Eigen::VectorXd::Zero(displacement_m.size());
  for (std::size_t t = 0; t < elements_.size(); ++t) {
    const LinearElement& element = elements_[t];
    const Eigen::Matrix3d stress_pa =
        first_piola_stress(linear_.material_of(t), stretches(t, displacement_m));
    for (std::size_t a = 0; a < 4; ++a) {
      force_n.segment<3>(static_cast<Eigen::Index>(3 * std::size_t{linear_.mesh().tetrahedra[t][a]})) +=
          element.volume_m3 * stress_pa * element.gradients.row(static_cast<Eigen::Index>(a)).transpose();
    }
  }
  return force_n;
}

double CorotationalBody::energy_j(const Eigen::VectorXd& displacement_m) const {
  double energy_j = 0;
  for (std::size_t t = 0; t < elements_.size(); ++t) {
    energy_j += elements_[t].volume_m3 * energy_density(linear_.material_of(t), stretches(t, displacement_m));
  }
  return energy_j;
}

StiffnessMatrix CorotationalBody::stiffness(const Eigen::VectorXd& displacement_m,
                                            Curvature curvature) const {
  return {linear_.mesh(), [&](std::size_t t) {
            return corotational_stiffness(elements_[t], linear_.material_of(t), stretches(t, displacement_m),
                                          curvature);
          }};
}

bool CorotationalBody::any_inverted(const Eigen::VectorXd& displacement_m) const {
  for (std::size_t t = 0; t < elements_.size(); ++t) {
    if (!(stretches(t, displacement_m).stretch[2] > 0)) return true;
  }
  return false;
}

double CorotationalBody::tolerance_n(double largest_n) const {
  return std::max(kLargestResidual * largest_n, rounding_n_);
}

std::vector<SymmetricTensor> CorotationalBody::stress_pa(const Eigen::VectorXd& displacement_m) const {
  std::vector<SymmetricTensor> stress_pa;
  stress_pa.reserve(elements_.size());
  for (std::size_t t = 0; t < elements_.size(); ++t)
    stress_pa.push_back(corotated_stress(linear_.material_of(t), stretches(t, displacement_m)));
  return stress_pa;
}

}  // namespace kiroku::sim

// Elastostatics with large rotations: what turns keeps its volume, where linear elements would swell.
//
// Source: the minimum of sum V W(F) - f . u over displacements that keep what is prescribed (the energy of
// corotational_element.h), by Newton's method with a line search; loads and prescribed displacements grow in
// steps that are halved where one does not converge.
#pragma once

#include "sim/fem/corotational_element.h"
#include "sim/fem/elastic_body.h"

namespace kiroku::sim {

/// All of a result is finite, and no element is inverted in it. Not thread-safe.
class CorotationalBody {
 public:
  /// What ElasticBody refuses, and nodes with axes of their own.
  CorotationalBody(TetMesh mesh, const Materials& materials, Constraints constraints);

  /// With which it begins: the same body for small displacements.
  [[nodiscard]] const ElasticBody& linear() const { return linear_; }

  struct Solution : StaticSolution {
    int factorisations = 0;  // beyond the linear one
  };
  /// `force_n` (3 |V|), finite; forces keep their direction. Equilibrium to 1e-9 of the largest force.
  /// kiroku::Error where no equilibrium is found: loads under which it would buckle or be crushed.
  [[nodiscard]] Solution solve(const Eigen::VectorXd& force_n) const;

  /// corotated_stress(), constant in each tetrahedron; (|T|).
  [[nodiscard]] std::vector<SymmetricTensor> stress_pa(const Eigen::VectorXd& displacement_m) const;

  /// The energy's derivatives at any displacement (3 |V|), for those who seek an equilibrium of their own:
  /// its value, J; its gradient, (3 |V|), N, what the nodes are pushed by to stay there; its curvature.
  [[nodiscard]] double energy_j(const Eigen::VectorXd& displacement_m) const;
  [[nodiscard]] Eigen::VectorXd inner_force_n(const Eigen::VectorXd& displacement_m) const;
  [[nodiscard]] StiffnessMatrix stiffness(const Eigen::VectorXd& displacement_m, Curvature curvature) const;
  /// Whether an element is turned inside out, or flat.
  [[nodiscard]] bool any_inverted(const Eigen::VectorXd& displacement_m) const;
  /// Forces out of balance that count as none where the largest at a node is `largest_n`, N.
  [[nodiscard]] double tolerance_n(double largest_n) const;

 private:
  class Search;
  [[nodiscard]] PrincipalStretches stretches(std::size_t t, const Eigen::VectorXd& displacement_m) const;

  ElasticBody linear_;
  std::vector<LinearElement> elements_;  // (|T|)
  double rounding_n_ = 0;                // of the forces of a body that is only turned
};

}  // namespace kiroku::sim

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

 private:
  class Search;
  ElasticBody linear_;
  std::vector<LinearElement> elements_;  // (|T|)
};

}  // namespace kiroku::sim

// Linear elastostatics: a body that is held somewhere, factorised once, solved for many loads.
//
// Source: small displacements, K u = f with 4-node tetrahedra (Zienkiewicz and Taylor, "The Finite Element
// Method", vol. 1). Prescribed displacements are eliminated, not penalised, so that they hold to the bit.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "sim/fem/constraints.h"
#include "sim/fem/element.h"
#include "sim/fem/factorisation.h"
#include "sim/fem/material.h"
#include "sim/fem/stiffness.h"
#include "sim/mesh/mesh_change.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// By region.
using Materials = std::map<std::int32_t, Material>;

struct StaticSolution {
  Eigen::VectorXd
      displacement_m;  // (3 |V|); zero for nodes that belong to no tetrahedron and are not prescribed
  /// (3 |V|), N: what holds the prescribed components, on top of the loads there; zero for all others.
  Eigen::VectorXd reaction_force_n;
};

/// All of a result is finite. Not thread-safe but where a function says so.
class ElasticBody {
 public:
  /// kiroku::Error in one sentence for: elements that are flat or inverted, regions without a material and
  /// unsound materials, and for everything that can still move as a rigid body, saying how.
  ElasticBody(TetMesh mesh, const Materials& materials, Constraints constraints);

  [[nodiscard]] std::size_t unknowns() const { return factorisation_->unknowns(); }
  [[nodiscard]] const TetMesh& mesh() const { return mesh_; }
  [[nodiscard]] const Constraints& constraints() const { return constraints_; }
  [[nodiscard]] const Material& material_of(std::size_t tetrahedron) const {
    return *material_of_[tetrahedron];
  }
  /// Those that a solve finds, (3 |V|): of nodes in use, not prescribed.
  [[nodiscard]] const std::vector<bool>& free() const { return free_; }
  /// In which its nodes are eliminated.
  [[nodiscard]] const std::vector<std::uint32_t>& order() const { return order_; }
  /// How many components of the node's displacement are not prescribed: 0 to 3, 0 if it belongs to no
  /// tetrahedron.
  [[nodiscard]] std::size_t free_components(std::size_t node) const;

  /// Takes a change of its mesh: nodes that move, tetrahedra that go. `adrift` names tetrahedra that are
  /// still there and hang on nothing that is held: they bear nothing any longer, and nodes that belong to no
  /// others stay where they were, whatever pulls at them. So the unknowns stay the same, and only the part of
  /// the factor that depends on the change is computed again. kiroku::Error where what is left is not held,
  /// or an element has no volume; the body is of no use after one.
  void apply(const MeshChange& change, std::span<const std::uint32_t> adrift);

  /// The weight of each tetrahedron that bears, a quarter at each of its nodes; (3 |V|), N.
  [[nodiscard]] Eigen::VectorXd weight_n(const Vector3& gravity_m_s2) const;

  /// What of `force_n` (3 |V|) pulls at nodes that belong to a tetrahedron that bears; zero elsewhere.
  [[nodiscard]] Eigen::VectorXd borne_n(Eigen::VectorXd force_n) const;

  /// `force_n` (3 |V|), finite. One step of iterative refinement after the solve. kiroku::Error where the
  /// result would not be finite, or the equations are not met to 1e-9 of their largest term.
  [[nodiscard]] StaticSolution solve(const Eigen::VectorXd& force_n) const;
  /// The same components prescribed, with other displacements: `prescribed_m` (3 |V|), along the nodes' own
  /// axes as the constraints have them; what it says of components that are free is ignored.
  [[nodiscard]] StaticSolution solve(const Eigen::VectorXd& force_n,
                                     const Eigen::VectorXd& prescribed_m) const;

  /// Columns of K^-1: how forces of 1 N at the nodes, along x, y and z, displace all; (3 |V| x 3 m), m/N,
  /// zero where nothing is free. kiroku::Error where that is not finite. Thread-safe, beside solve() too. The
  /// same nodes in the same order give the same bits.
  [[nodiscard]] Eigen::MatrixXd compliance_columns(std::span<const std::uint32_t> nodes) const;

  /// Constant in each tetrahedron, zero in those that bear nothing; (|T|).
  [[nodiscard]] std::vector<SymmetricTensor> strain(const Eigen::VectorXd& displacement_m) const;
  [[nodiscard]] std::vector<SymmetricTensor> stress_pa(const Eigen::VectorXd& displacement_m) const;
  /// Of one of them.
  [[nodiscard]] SymmetricTensor stress_pa(const Eigen::VectorXd& displacement_m,
                                          std::size_t tetrahedron) const;
  /// Averages over the tetrahedra around each node, weighted by volume; (|V|), zero for loose nodes.
  [[nodiscard]] std::vector<SymmetricTensor> at_nodes(
      const std::vector<SymmetricTensor>& of_tetrahedra) const;

 private:
  TetMesh mesh_;
  Materials materials_;
  Constraints constraints_;
  std::vector<const Material*> material_of_;  // (|T|), in materials_
  std::vector<bool> bears_;                   // (|T|)
  std::vector<bool> used_;                    // (|V|), by a tetrahedron that bears
  std::vector<bool> free_;
  std::vector<std::uint32_t> order_;
  std::unique_ptr<StiffnessMatrix> stiffness_;
  std::unique_ptr<Factorisation> factorisation_;
};

}  // namespace kiroku::sim

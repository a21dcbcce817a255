// The corotational tetrahedron: Hooke's law in a frame that turns with the element. Pure functions,
// thread-safe.
//
// Source: with F the deformation gradient, F = R S its polar decomposition, the energy density
//   W = mu |F - R|^2 + lambda / 2 tr(S - I)^2
// gives the corotational forces of linear elements exactly, P = dW/dF = 2 mu (F - R) + lambda tr(S - I) R
// (McAdams et al., "Efficient elasticity for character skinning with contact and collisions", 2011, section
// 4). Its second derivative is 2 mu I + lambda R:R, less what the turning of R takes away in the three planes
// of the principal stretches (the same, section 5).
#pragma once

#include <Eigen/Core>

#include "sim/fem/element.h"

namespace kiroku::sim {

/// F = I + sum over nodes of u_a g_a^T. Row a of `displacements_m`: node a's.
Eigen::Matrix3d deformation_gradient(const LinearElement& element,
                                     const Eigen::Matrix<double, 4, 3>& displacements_m);

/// F = U diag(s) V^T with U and V rotations: an inverted element has its smallest stretch negative.
struct PrincipalStretches {
  Eigen::Matrix3d left, right;  // U, V
  Vector3 stretch;              // s, descending in magnitude
  [[nodiscard]] Eigen::Matrix3d rotation() const { return left * right.transpose(); }
};
/// Of any finite F, singular ones too.
PrincipalStretches principal_stretches(const Eigen::Matrix3d& gradient);

/// W, J per m^3 of the undeformed element.
double energy_density(const Material& material, const PrincipalStretches& at);
/// P, Pa: the force at node a is -V P g_a.
Eigen::Matrix3d first_piola_stress(const Material& material, const PrincipalStretches& at);
/// Hooke's stress in the turned frame, R (lambda tr(S - I) I + 2 mu (S - I)) R^T; Pa.
SymmetricTensor corotated_stress(const Material& material, const PrincipalStretches& at);

using ElementMatrix = Eigen::Matrix<double, 12, 12>;
enum class Curvature {
  kExact,   // of which compressed elements have negative parts
  kConvex,  // the nearest positive semidefinite matrix, so that minimisation always goes downhill
};
/// The second derivative of V W with respect to the positions of the four nodes, N/m. At rest it is the
/// linear element's matrix.
ElementMatrix corotational_stiffness(const LinearElement& element, const Material& material,
                                     const PrincipalStretches& at, Curvature curvature);

}  // namespace kiroku::sim

// The linear (constant-strain) tetrahedron. Pure functions, thread-safe.
#pragma once

#include <Eigen/Core>

#include "sim/fem/material.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

struct LinearElement {
  /// Row a: the gradient of node a's shape function, 1/m. The rows sum to zero.
  Eigen::Matrix<double, 4, 3> gradients;
  double volume_m3 = 0;
};
/// Of a tetrahedron of positive volume.
LinearElement element_of(const TetMesh& mesh, std::size_t tetrahedron);

/// K_ab = V (lambda g_a g_b^T + mu g_b g_a^T + mu (g_a . g_b) I): the force at node a, N, of a unit
/// displacement of node b, m. K_ba is its transpose.
Eigen::Matrix3d stiffness_block(const LinearElement& element, const Material& material, Eigen::Index a,
                                Eigen::Index b);

/// A symmetric tensor's XX, YY, ZZ, XY, YZ, XZ, in VTK's order.
using SymmetricTensor = Eigen::Matrix<double, 6, 1>;

/// Tensor components, so that XY is half of the engineering shear strain. Row a of `displacements_m`: node
/// a's.
SymmetricTensor strain_of(const LinearElement& element, const Eigen::Matrix<double, 4, 3>& displacements_m);
/// Hooke's law: lambda tr(strain) I + 2 mu strain; Pa.
SymmetricTensor stress_of(const Material& material, const SymmetricTensor& strain);
double von_mises(const SymmetricTensor& stress);

}  // namespace kiroku::sim

#include "sim/fem/element.h"

#include <cmath>

#include <Eigen/Geometry>

namespace kiroku::sim {

LinearElement element_of(const TetMesh& mesh, std::size_t tetrahedron) {
  const Tetrahedron& corner = mesh.tetrahedra[tetrahedron];
  const Vector3& a = mesh.nodes[corner[0]];
  const Vector3 ab = mesh.nodes[corner[1]] - a;
  const Vector3 ac = mesh.nodes[corner[2]] - a;
  const Vector3 ad = mesh.nodes[corner[3]] - a;
  const double six_volumes = ab.cross(ac).dot(ad);
  LinearElement element;
  element.volume_m3 = six_volumes / 6;
  element.gradients.row(1) = (ac.cross(ad) / six_volumes).transpose();
  element.gradients.row(2) = (ad.cross(ab) / six_volumes).transpose();
  element.gradients.row(3) = (ab.cross(ac) / six_volumes).transpose();
  element.gradients.row(0) =
      -(element.gradients.row(1) + element.gradients.row(2) + element.gradients.row(3));
  return element;
}

Eigen::Matrix3d stiffness_block(const LinearElement& element, const Material& material, Eigen::Index a,
                                Eigen::Index b) {
  const Vector3 at_a = element.gradients.row(a), at_b = element.gradients.row(b);
  const double lambda = element.volume_m3 * material.lame_lambda_pa();
  const double mu = element.volume_m3 * material.shear_modulus_pa();
  Eigen::Matrix3d block = lambda * at_a * at_b.transpose() + mu * at_b * at_a.transpose();
  block.diagonal().array() += mu * at_a.dot(at_b);
  return block;
}

SymmetricTensor strain_of(const LinearElement& element, const Eigen::Matrix<double, 4, 3>& displacements_m) {
  const Eigen::Matrix3d gradient = displacements_m.transpose() * element.gradients;
  SymmetricTensor strain;
  strain << gradient(0, 0), gradient(1, 1), gradient(2, 2), (gradient(0, 1) + gradient(1, 0)) / 2,
      (gradient(1, 2) + gradient(2, 1)) / 2, (gradient(0, 2) + gradient(2, 0)) / 2;
  return strain;
}

SymmetricTensor stress_of(const Material& material, const SymmetricTensor& strain) {
  SymmetricTensor stress = 2 * material.shear_modulus_pa() * strain;
  stress.head<3>().array() += material.lame_lambda_pa() * strain.head<3>().sum();
  return stress;
}

double von_mises(const SymmetricTensor& stress) {
  const double xy = stress[0] - stress[1], yz = stress[1] - stress[2], zx = stress[2] - stress[0];
  return std::sqrt((xy * xy + yz * yz + zx * zx) / 2 + 3 * stress.tail<3>().squaredNorm());
}

}  // namespace kiroku::sim

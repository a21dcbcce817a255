#include "sim/fem/corotational_element.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/LU>
#include <Eigen/SVD>

namespace kiroku::sim {
namespace {

/// tr(S - I).
double dilation(const PrincipalStretches& at) { return at.stretch.sum() - 3; }

}  // namespace

Eigen::Matrix3d deformation_gradient(const LinearElement& element,
                                     const Eigen::Matrix<double, 4, 3>& displacements_m) {
  return Eigen::Matrix3d::Identity() + displacements_m.transpose() * element.gradients;
}

PrincipalStretches principal_stretches(const Eigen::Matrix3d& gradient) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(gradient, Eigen::ComputeFullU | Eigen::ComputeFullV);
  PrincipalStretches at{svd.matrixU(), svd.matrixV(), svd.singularValues()};
  // A mirror image is taken for a rotation that turns the element's thinnest direction inside out.
  if (at.left.determinant() < 0) {
    at.left.col(2) *= -1;
    at.stretch[2] *= -1;
  }
  if (at.right.determinant() < 0) {
    at.right.col(2) *= -1;
    at.stretch[2] *= -1;
  }
  return at;
}

double energy_density(const Material& material, const PrincipalStretches& at) {
  const double spread = (at.stretch.array() - 1).square().sum(), sum = dilation(at);
  return material.shear_modulus_pa() * spread + material.lame_lambda_pa() / 2 * sum * sum;
}

Eigen::Matrix3d first_piola_stress(const Material& material, const PrincipalStretches& at) {
  const Vector3 principal_pa =
      (2 * material.shear_modulus_pa() * (at.stretch.array() - 1) + material.lame_lambda_pa() * dilation(at))
          .matrix();
  return at.left * principal_pa.asDiagonal() * at.right.transpose();
}

SymmetricTensor corotated_stress(const Material& material, const PrincipalStretches& at) {
  const Eigen::Matrix3d stress_pa =
      first_piola_stress(material, at) * at.right * at.left.transpose();  // P R^T
  SymmetricTensor tensor;
  tensor << stress_pa(0, 0), stress_pa(1, 1), stress_pa(2, 2), (stress_pa(0, 1) + stress_pa(1, 0)) / 2,
      (stress_pa(1, 2) + stress_pa(2, 1)) / 2, (stress_pa(0, 2) + stress_pa(2, 0)) / 2;
  return tensor;
}

ElementMatrix corotational_stiffness(const LinearElement& element, const Material& material,
                                     const PrincipalStretches& at, Curvature curvature) {
  const double mu = material.shear_modulus_pa(), lambda = material.lame_lambda_pa();
  // Each rank-one term m m^T of the density's second derivative acts on the nodes by m g_a.
  using Mode = Eigen::Matrix<double, 12, 1>;
  const auto mode_of = [&](const Eigen::Matrix3d& matrix) {
    Mode mode;
    for (Eigen::Index a = 0; a < 4; ++a)
      mode.segment<3>(3 * a) = matrix * element.gradients.row(a).transpose();
    return mode;
  };
  ElementMatrix stiffness = ElementMatrix::Zero();
  const Eigen::Matrix4d products = 2 * mu * element.gradients * element.gradients.transpose();
  for (Eigen::Index a = 0; a < 4; ++a) {
    for (Eigen::Index b = 0; b < 4; ++b)
      stiffness.block<3, 3>(3 * a, 3 * b).diagonal().setConstant(products(a, b));
  }
  const Mode swelling = mode_of(at.rotation());
  stiffness += lambda * swelling * swelling.transpose();
  constexpr std::array<std::array<Eigen::Index, 2>, 3> kPlanes{{{0, 1}, {1, 2}, {2, 0}}};
  for (const auto& [j, k] : kPlanes) {
    // Turning in this plane costs 2 mu less what R gives by following; at rest nothing is left of it, and
    // less than nothing under pressure.
    const double sum = at.stretch[j] + at.stretch[k];
    double following = 2 * (lambda * dilation(at) - 2 * mu) / sum;
    if (curvature == Curvature::kConvex) following = sum > 0 ? std::max(following, -2 * mu) : -2 * mu;
    const Mode turning = mode_of(
        (at.left.col(j) * at.right.col(k).transpose() - at.left.col(k) * at.right.col(j).transpose()) /
        std::sqrt(2.0));
    stiffness += following * turning * turning.transpose();
  }
  return element.volume_m3 * stiffness;
}

}  // namespace kiroku::sim

#include "sim/fem/constraints.h"

#include <Eigen/LU>

#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::sim {

Constraints::Constraints(std::size_t nodes)
    : displacement_m_(Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * nodes))),
      source_(3 * nodes, kFree) {}

void Constraints::turn(std::size_t node, const Eigen::Matrix3d& axes) {
  constexpr double kRotation = 1e-9;
  // Written so that what is no number is refused as well.
  const bool rotation =
      (axes.transpose() * axes - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= kRotation &&
      axes.determinant() > 0;
  if (!rotation) throw Error("the axes of node " + std::to_string(node) + " are not those of a rotation");
  for (std::size_t component = 0; component < 3; ++component) {
    if (!prescribed(3 * node + component)) continue;
    throw Error("node " + std::to_string(node) + " cannot be given axes of its own: " +
                sources_[source_[3 * node + component]] + " prescribes how it moves already");
  }
  if (axes_.empty()) axes_.assign(source_.size() / 3, Eigen::Matrix3d::Identity());
  axes_[node] = axes;
}

Eigen::VectorXd Constraints::to_own_axes(Eigen::VectorXd vectors) const {
  for (std::size_t node = 0; node < axes_.size(); ++node) {
    auto vector = vectors.segment<3>(static_cast<Eigen::Index>(3 * node));
    vector = (axes_[node].transpose() * vector).eval();
  }
  return vectors;
}

Eigen::VectorXd Constraints::from_own_axes(Eigen::VectorXd vectors) const {
  for (std::size_t node = 0; node < axes_.size(); ++node) {
    auto vector = vectors.segment<3>(static_cast<Eigen::Index>(3 * node));
    vector = (axes_[node] * vector).eval();
  }
  return vectors;
}

void Constraints::prescribe(std::size_t node, std::size_t component, double displacement_m,
                            const std::string& source) {
  const std::size_t number = 3 * node + component;
  double& prescribed_m = displacement_m_[static_cast<Eigen::Index>(number)];
  if (prescribed(number)) {
    if (prescribed_m == displacement_m) return;
    constexpr const char* kNames[] = {"x", "y", "z"};
    constexpr const char* kOwnNames[] = {"its first axis", "its second axis", "its third axis"};
    const bool own = turned() && axes_[node] != Eigen::Matrix3d::Identity();
    throw Error(source + " moves node " + std::to_string(node) + " by " + number_text(displacement_m) +
                " m along " + (own ? kOwnNames : kNames)[component] + ", " + sources_[source_[number]] +
                " by " + number_text(prescribed_m) + " m: only one of them can be");
  }
  // Components of one source come one after the other.
  if (sources_.empty() || sources_.back() != source) sources_.push_back(source);
  source_[number] = static_cast<std::uint32_t>(sources_.size() - 1);
  prescribed_m = displacement_m;
}

void Constraints::prescribe(std::size_t node, const Eigen::Vector3d& displacement_m,
                            const std::string& source) {
  for (std::size_t component = 0; component < 3; ++component) {
    prescribe(node, component, displacement_m[static_cast<Eigen::Index>(component)], source);
  }
}

}  // namespace kiroku::sim

#include "sim/fem/constraints.h"

#include <algorithm>

#include "base/error.h"
#include "sim/fem/number_text.h"

namespace kiroku::sim {

Constraints::Constraints(std::size_t nodes)
    : displacement_m_(Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * nodes))),
      source_(3 * nodes, kFree) {}

void Constraints::prescribe(std::size_t node, std::size_t component, double displacement_m,
                            const std::string& source) {
  const std::size_t number = 3 * node + component;
  double& prescribed_m = displacement_m_[static_cast<Eigen::Index>(number)];
  if (prescribed(number)) {
    if (prescribed_m == displacement_m) return;
    constexpr const char* kNames[] = {"x", "y", "z"};
    throw Error(source + " moves node " + std::to_string(node) + " by " + number_text(displacement_m) +
                " m along " + kNames[component] + ", " + sources_[source_[number]] + " by " +
                number_text(prescribed_m) + " m: only one of them can be");
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

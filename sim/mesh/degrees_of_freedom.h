// Where a node's three coordinates stand in a vector of 3|V| numbers.
#pragma once

#include <cstddef>

#include <Eigen/Core>

namespace kiroku::sim {

/// The row of the node's x; y and z follow.
inline Eigen::Index first_row(std::size_t node) { return static_cast<Eigen::Index>(3 * node); }

}  // namespace kiroku::sim

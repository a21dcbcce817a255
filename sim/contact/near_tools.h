// Which nodes of a surface tools may meet next.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sim/contact/contact_solver.h"
#include "sim/contact/point_tree.h"

namespace kiroku::sim {

/// Which nodes of the surface, as they lie now, are within `margin_m` of a tool (in it by as much where it is
/// negative); marks them in `near` (|surface|), whether any was not marked before. `tree` is that of the
/// positions (3 |surface|), `poses` one a tool. Thread-safe; allocates nothing.
bool mark_near(const PointTree& tree, const Eigen::VectorXd& positions_m, std::span<const ContactTool> tools,
               std::span<const Pose> poses, double margin_m, std::vector<std::uint8_t>& near);

}  // namespace kiroku::sim

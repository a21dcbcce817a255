// What a planned operation's frame looks like beside its tissue. Pure, thread-safe.
#pragma once

#include <vector>

#include "sim/plan/plan_run.h"
#include "sim/render/solid_shapes.h"

namespace kiroku::sim {

/// The tools that are at the organ: jaws as two plates, scalpels as a blade along their edge.
std::vector<Solid> tools_of(const Plan& plan, const PlanFrame& frame);

/// A small ball at each node that a tool holds or presses, `radius_m` large.
std::vector<Solid> contact_points_of(const TetMesh& mesh, const PlanFrame& frame, double radius_m);

}  // namespace kiroku::sim

#include "sim/render/plan_scene.h"

#include <algorithm>

namespace kiroku::sim {
namespace {

constexpr Rgb kSteel{190, 195, 205}, kFinger{224, 182, 150}, kContact{255, 214, 64};
constexpr double kPlateM = 1e-3;

/// Two plates at the sides of what the jaws hold, across its shortest edge.
void add_jaws(const Box& region, const Pose& pose, std::vector<Solid>& solids) {
  Eigen::Index across = 0;
  region.half_extent_m.minCoeff(&across);
  for (const double side : {-1.0, 1.0}) {
    Box plate = region;
    Vector3 offset = Vector3::Zero();
    offset[across] = side * (region.half_extent_m[across] + kPlateM);
    plate.half_extent_m[across] = kPlateM;
    Pose at = pose;
    at.position_m = pose.from_tool(offset);
    solids.push_back({plate, at, kSteel});
  }
}

}  // namespace

std::vector<Solid> tools_of(const Plan& plan, const PlanFrame& frame) {
  std::vector<Solid> solids;
  for (std::size_t number = 0; number < plan.tools.size(); ++number) {
    if (!frame.poses[number]) continue;
    const PlanTool& tool = plan.tools[number];
    const Pose& pose = *frame.poses[number];
    if (tool.kind == ToolKind::kScalpel) {
      Pose middle = pose;
      middle.position_m = pose.from_tool(Vector3(0, 0, tool.edge_m / 2));
      solids.push_back({Box{{2 * kPlateM, kPlateM / 4, tool.edge_m / 2}}, middle, kSteel});
    } else if (closes(tool.kind)) {
      for (const Pose& jaw : jaw_poses(pose, tool.jaw_half_extent_m(), frame.grips[number].opening_m))
        solids.push_back({tool.tool.shape, jaw, kSteel});
    } else if (const auto* region = std::get_if<Box>(&tool.tool.shape);
               region != nullptr && binds(tool.kind)) {
      add_jaws(*region, pose, solids);
    } else {
      solids.push_back({tool.tool.shape, pose, tool.kind == ToolKind::kFinger ? kFinger : kSteel});
    }
  }
  return solids;
}

std::vector<Solid> contact_points_of(const TetMesh& mesh, const PlanFrame& frame, double radius_m) {
  std::vector<Solid> solids;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    const auto at = static_cast<Eigen::Index>(3 * node);
    if (frame.tool_force_n.segment<3>(at).isZero(0)) continue;
    Pose pose;
    pose.position_m = mesh.nodes[node] + frame.displacement_m.segment<3>(at);
    solids.push_back({Sphere{radius_m}, pose, kContact});
  }
  return solids;
}

}  // namespace kiroku::sim

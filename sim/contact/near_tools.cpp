#include "sim/contact/near_tools.h"

namespace kiroku::sim {

bool mark_near(const PointTree& tree, const Eigen::VectorXd& positions_m, std::span<const ContactTool> tools,
               std::span<const Pose> poses, double margin_m, std::vector<std::uint8_t>& near) {
  bool any = false;
  for (std::size_t tool = 0; tool < tools.size(); ++tool) {
    const ToolShape& shape = tools[tool].shape;
    tree.visit_near(poses[tool].position_m, bounding_radius_m(shape) + margin_m, [&](std::size_t place) {
      if (near[place] != 0) return;
      const Vector3 at_m = positions_m.segment<3>(static_cast<Eigen::Index>(3 * place));
      if (distance_to(shape, poses[tool].to_tool(at_m)).distance_m > margin_m) return;
      near[place] = 1;
      any = true;
    });
  }
  return any;
}

}  // namespace kiroku::sim

// What a person does on the page while planning, as values (docs/reference/viewer.md, "Planning"). Plain
// data.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "viewer/planning/pointer_tools.h"

namespace kiroku::viewer {

/// From where the organ is seen (sim::ViewDirection); pan in parts of the picture, to the right and down.
struct ViewDeed {
  double azimuth_deg = 0, elevation_deg = 0, zoom = 1, pan_x = 0, pan_y = 0;
};
/// All pointers that are down now.
struct PointDeed {
  PointerUse use = PointerUse::kGrasp;
  std::vector<PlanPointer> pointers;
};
/// A line drawn on the picture, cut as deep as that below the surface.
struct CutDeed {
  std::vector<Eigen::Vector2d> line;  // as PlanPointer's x and y
  double depth_m = 0;
};
/// Moves a handle of the cut that is this step of the plan to a place of the picture, changes the depth
/// there, or both; the cut is made anew.
struct HandleDeed {
  std::size_t step = 0, handle = 0;
  std::optional<Eigen::Vector2d> at;  // as PlanPointer's x and y
  std::optional<double> depth_m;
};
struct HoldDeed {
  double duration_s = 0;
};
struct ReleaseDeed {
  std::string tool;
};
/// Of a grasper or a clip at the organ: its jaws' distance becomes this share of what it is.
struct CloseDeed {
  std::string tool;
  double share = 1;
};
struct UndoDeed {};
struct RedoDeed {};
/// Tints the tissue by its stress; nothing: not.
struct StressDeed {
  std::optional<double> largest_pa;
};
using Deed = std::variant<ViewDeed, PointDeed, CutDeed, HandleDeed, HoldDeed, ReleaseDeed, CloseDeed,
                          UndoDeed, RedoDeed, StressDeed>;

inline constexpr std::size_t kMostPlanPointers = 5;

}  // namespace kiroku::viewer

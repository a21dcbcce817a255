// Planning without a network: an organ, what a person does to it, and pictures of it. Belongs to the thread
// that made it.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/render/plan_pictures.h"
#include "viewer/planning/cut_handles.h"
#include "viewer/planning/plan_folder.h"
#include "viewer/planning/planning_deeds.h"

namespace kiroku::viewer {

struct TableOptions {
  std::string transfer = "liver";  // a name or file of sim::find_transfer_function()
  sim::EngineChoice engine;
  int width = 800, height = 600;
};

class PlanningTable {
 public:
  /// Carries out the steps that the plan has, or leaves them out where it begins anew; `progress` hears the
  /// time of each frame. What PlanRun and VolumeRenderer throw.
  PlanningTable(OpenedPlan opened, bool anew, const TableOptions& options,
                const std::function<void(double time_s)>& progress);

  /// kiroku::Error in one sentence for what cannot be done; then nothing was, but that pointers may be let
  /// go.
  void apply(const Deed& deed);
  /// One time step of the plan, where pointers move tools; false where none moves. Throws as apply().
  bool advance() { return pointers_.advance(); }
  /// What a person should know of what was done since the last call; one sentence each.
  [[nodiscard]] std::vector<std::string> take_remarks();

  /// `share` of the full width and height, 0 to 1; cross-sections are as much further apart. `moving` as in
  /// sim::Scene.
  [[nodiscard]] sim::Picture picture(double share, bool moving = false);

  [[nodiscard]] const sim::PlanSession& session() const { return session_; }
  [[nodiscard]] const OpenedPlan& opened() const { return opened_; }
  [[nodiscard]] std::string renderer() const { return pictures_.renderer().renderer(); }
  /// Where a place is on the picture, as PlanPointer's x and y.
  [[nodiscard]] Eigen::Vector2d on_picture(const sim::Vector3& place_m) const;
  /// Cuts with their handles, as the picture of now has them.
  [[nodiscard]] const std::vector<ShownCut>& cuts() const { return drawn_cuts_.shown(session_, camera_); }
  /// Lets go of what moves, and writes down the plan as it is now.
  [[nodiscard]] nlohmann::ordered_json document(const std::string& name);

 private:
  void look(const ViewDeed& view);
  void cut(const CutDeed& cut);
  void change(const HandleDeed& handle);
  [[nodiscard]] std::size_t tool_named(const std::string& name) const;

  TableOptions options_;
  OpenedPlan opened_;
  sim::PlanSession session_;
  PointerTools pointers_;
  sim::Camera camera_;
  sim::PlanPictures pictures_;
  double voxel_m_;
  double edge_m_;                     // mean, of the surface before any cut
  mutable DrawnCuts drawn_cuts_;      // remembers what it found for the picture before
  std::size_t remarked_ = 0;          // steps whose remarks were told
  std::vector<std::string> remarks_;  // that come of no step
};

}  // namespace kiroku::viewer

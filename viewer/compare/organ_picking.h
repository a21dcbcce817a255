// A plan's pictures to pick on: from any side, at any of its moments, and which point of the organ is under a
// place of them. Belongs to the thread that made it.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/mesh/mesh_topology.h"
#include "sim/plan/plan_frames.h"
#include "sim/render/plan_pictures.h"

namespace kiroku::compare {

/// From where and when the organ is seen. Pan in parts of the picture, to the right and down.
struct PickingView {
  std::size_t step = 0;  // of the plan's, from 0
  double plan_s = 0;
  double azimuth_deg = 0, elevation_deg = 0, zoom = 1, pan_x = 0, pan_y = 0;
  int width = 0, height = 0;
};

class OrganPicking {
 public:
  /// Plan and frames outlive the object. kiroku::Error as sim::VolumeRenderer throws it.
  OrganPicking(const sim::Plan& plan, const sim::PlanFrames& frames,
               std::shared_ptr<const sim::ShadedVolume> volume, const sim::TransferFunction& transfer,
               const sim::EngineChoice& choice);

  [[nodiscard]] sim::Camera camera(const PickingView& view) const;
  sim::Picture picture(const PickingView& view);
  /// Where the line through a place of the picture, from 0 at its left upper corner to 1, first meets the
  /// organ as it lies then: the surface of its mesh, in patient coordinates. Nothing beside the organ.
  [[nodiscard]] std::optional<sim::Vector3> organ_at(const PickingView& view, double x, double y);

  [[nodiscard]] const sim::Plan& plan() const { return plan_; }

 private:
  const sim::Plan& plan_;
  const sim::PlanFrames& frames_;
  sim::PlanPictures pictures_;
  std::shared_ptr<const sim::TetMesh> faces_of_;  // what the surface is of; a cut makes another mesh
  std::vector<sim::Face> surface_;
};

/// Answers one question, a JSON object (docs/reference/viewer.md, "Picking"): {"picture": …}, {"point": …} or
/// {"registration": …}, by one without line breaks; {"refused": "a sentence"} for what is none, or cannot be.
std::string answer_picking(OrganPicking& picking, std::string_view question);

}  // namespace kiroku::compare

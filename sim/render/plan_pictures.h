// Pictures of a planned operation: its tissue, its tools, and where they hold. Belongs to the thread that
// made it.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "sim/plan/plan_run.h"
#include "sim/render/volume_renderer.h"

namespace kiroku::sim {

/// A ball around the organ, with some room for what moves.
Ball view_of_plan(const Plan& plan);

struct PlanPictureOptions {
  bool contacts = true;              // a small ball at each node that a tool holds or presses
  std::optional<double> largest_pa;  // tints tissue by its stress; what the last colour stands for
};

class PlanPictures {
 public:
  /// kiroku::Error as VolumeRenderer throws it. The plan must outlive the object. `scene` says from where and
  /// how large; its solids and stress are the object's.
  PlanPictures(const Plan& plan, std::shared_ptr<const ShadedVolume> volume, const TransferFunction& transfer,
               const EngineChoice& choice, Scene scene, PlanPictureOptions options = {});

  /// Frame and mesh of one moment; its stress is only needed for the tint.
  Picture picture(const PlanFrame& frame, const TetMesh& mesh);
  void set_camera(const Camera& camera) { scene_.camera = camera; }
  /// Of the pictures from now on; the distance of cross-sections, and whether they move, as in Scene.
  void set_size(int width, int height, double spacing_m, bool moving = false);
  /// As PlanPictureOptions has it; nothing for no tint.
  void set_largest_pa(std::optional<double> largest_pa) { options_.largest_pa = largest_pa; }
  [[nodiscard]] const Scene& scene() const { return scene_; }
  [[nodiscard]] const VolumeRenderer& renderer() const { return renderer_; }

 private:
  const Plan& plan_;
  Scene scene_;
  PlanPictureOptions options_;
  VolumeRenderer renderer_;
  double contact_radius_m_ = 0;
  TetMesh shown_;
};

}  // namespace kiroku::sim

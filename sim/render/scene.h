// What a picture shows beside the tissue, and how. Plain data.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "sim/render/camera.h"
#include "sim/render/lens_rays.h"
#include "sim/render/solid_shapes.h"

namespace kiroku::sim {

/// Tissue tinted by viridis of a stress.
struct StressTint {
  std::vector<double> at_nodes_pa;  // (|V|), 0 and more
  double largest_pa = 0;            // what the last colour stands for; more than 0
  double share = 0.7;               // of the tint in the tissue's colour, 0 to 1
};

/// The mesh's surface as a thin sheet around the tissue.
struct SurfaceSheet {
  Rgb colour{230, 200, 160};
  double opacity = 0.25;  // 0 to 1
};

/// The light of an endoscope, beside its lens and carried along with it. It falls off with the square of the
/// distance, and tissue is wet (tip_lighting.h).
struct TipLight {
  Vector3 at_m{0, 0.003, 0};  // in the view's axes
  /// At this distance it lights as Scene::to_light would.
  double working_distance_m = 0.08;
  double wet = 1;           // share of the film of water, 0 to 1
  double roughness = 0.25;  // of the film, more than 0 to 1
};

struct Scene {
  Camera camera;
  int width = 512, height = 512;
  Rgb background{18, 20, 24};
  /// Towards the light, in the view's axes: it is carried along with the camera.
  Vector3 to_light{-0.5, 0.6, 1};
  /// Instead of that light, in numbers that are linear in light.
  std::optional<TipLight> tip_light;
  /// Of a picture of this size, instead of the camera's field: what each pixel looks at.
  std::shared_ptr<const LensRays> lens;
  /// The picture is a disc in black, as wide as its lesser side.
  bool round = false;
  /// Between cross-sections, along the view; 0: kVoxelShare of the CT's least voxel spacing, and by a light
  /// at the tip kTipSpacingM at most; while the scene moves, kMovingVoxelShare.
  double spacing_m = 0;
  static constexpr double kVoxelShare = 0.5, kMovingVoxelShare = 0.8;
  static constexpr double kTipSpacingM = 0.2e-3;
  /// The picture is one of many of what moves: it may be coarser, as long as it is quicker. For what is kept,
  /// false.
  bool moving = false;
  std::vector<Solid> solids;
  std::optional<StressTint> stress;
  std::optional<SurfaceSheet> surface;
};

}  // namespace kiroku::sim

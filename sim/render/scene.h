// What a picture shows beside the tissue, and how. Plain data.
#pragma once

#include <optional>
#include <vector>

#include "sim/render/camera.h"
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

struct Scene {
  Camera camera;
  int width = 512, height = 512;
  Rgb background{18, 20, 24};
  /// Towards the light, in the view's axes: it is carried along with the camera.
  Vector3 to_light{-0.5, 0.6, 1};
  /// Between cross-sections, along the view; 0: half of the CT's least voxel spacing.
  double spacing_m = 0;
  std::vector<Solid> solids;
  std::optional<StressTint> stress;
  std::optional<SurfaceSheet> surface;
};

}  // namespace kiroku::sim

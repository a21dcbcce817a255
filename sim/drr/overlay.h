// A computed radiograph over a real one, with outlines and paths. Pure, thread-safe.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "sim/drr/picture.h"
#include "sim/drr/projection_geometry.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

enum class OverlayMode {
  kOpacity,       // one through the other
  kDifference,    // orange where the DRR is lighter, blue where the radiograph is, grey where they agree
  kCheckerboard,  // squares of the one and of the other
  kContour,       // edges of the DRR, in cyan, on the radiograph
  kBeside,        // the radiograph, and the DRR to the right of it
  kWipe,          // the DRR in the left part of the picture, the radiograph in the rest
};

/// What of each is shown, from black to white.
struct OverlayWindows {
  Window radiograph, drr;
};
/// Of both by itself (window_of()).
OverlayWindows overlay_windows(const ProjectionImage& radiograph, const ProjectionImage& drr);

/// Light where much attenuates, in `windows`, without which these are of the pictures themselves: a film
/// keeps those of its first. `opacity` of the DRR, 0 to 1; of a wipe how much of the width the DRR takes.
/// kiroku::Error for pictures of different sizes.
ColourPicture overlay_of(const ProjectionImage& radiograph, const ProjectionImage& drr, OverlayMode mode,
                         double opacity, const std::optional<OverlayWindows>& windows = {});

struct PixelLine {
  std::array<double, 2> from{}, to{};  // column, row
};
using Colour = std::array<std::uint8_t, 3>;
/// About a pixel and a half wide, smooth; what lies beside the picture is left out. `right_by` pixels are
/// added to columns.
void draw(ColourPicture& picture, std::span<const PixelLine> lines, const Colour& colour,
          double right_by = 0);

/// Where the surface of a region's tetrahedra turns away from the source, as a radiograph shows its edge;
/// parts that are not in front of the source are left out.
std::vector<PixelLine> outline_of(const TetMesh& mesh, std::int32_t region,
                                  const ProjectionGeometry& geometry);
/// From each point to the next.
std::vector<PixelLine> path_of(std::span<const Vector3> points_m, const ProjectionGeometry& geometry);

}  // namespace kiroku::sim

// The organ as it was deformed to fit a recorded picture, its displacement as colour. Functions are pure and
// thread-safe.
#pragma once

#include "sim/align/drawn_surface.h"
#include "sim/render/picture.h"
#include "viewer/compare/organ_deformation.h"

namespace kiroku::compare {

/// Over what is in the picture: viridis of how far a node departs from the plan, 0 to `scale_mm`, where all
/// of a face's nodes do (above 0); else grey.
void draw_departure(sim::Picture& picture, const sim::DrawnSurface& surface, const ShownDeformation& shown,
                    const std::vector<float>& beyond_m, double scale_mm);

/// Over what is in the picture: viridis of a node's displacement, 0 to `scale_mm`. Where a displacement is
/// not told, stripes of grey. What is beside or behind the eye is left out.
void draw_deformed(sim::Picture& picture, const sim::DrawnSurface& surface, const ShownDeformation& shown,
                   double scale_mm);

}  // namespace kiroku::compare

// What a subject sees of the plate.
#pragma once

#include "sim/render/surface_renderer.h"
#include "trainer/haptic_rate/plate.h"

namespace kiroku::trainer {

/// The plate's nodes, each in the colour of the finger's force that is nearest (colour_of_press), fading into
/// the tissue's colour 2 cm away from it. `poses` and `forces_n` one a finger; fingers that feel nothing
/// colour nothing.
std::vector<sim::Rgb> colours_of_touch(const Plate& plate, std::span<const sim::Pose> poses,
                                       std::span<const double> forces_n);

/// So many fingers, the first pressing with kLeastPressN, the last with kMostPressN and the others between;
/// 640 x 480, in software. kiroku::Error as SurfaceRenderer.
sim::Picture picture_of_press(const Plate& plate, std::size_t fingers);

}  // namespace kiroku::trainer

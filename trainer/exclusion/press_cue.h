// What is pressed, coloured by how hard, while it is pressed: blue near the lower force that the haptic-rate
// studies ask for, red near the higher one ("Haptic Rate for Surgical Manipulations with Fingers and
// Instruments", Figure 2; "Construction of Training Environment for Surgical Exclusion ...", section 5).
#pragma once

#include <span>

#include "sim/mesh/tet_mesh.h"
#include "sim/render/picture.h"
#include "trainer/exclusion/hand_forces.h"

namespace kiroku::trainer {

/// A colour laid over another: `share` 0 leaves the other, 1 covers it.
struct PressCue {
  sim::Rgb colour{};
  double share = 0;
};

/// For a finger that presses with that force, N: colour_of_press(), which comes in between half of
/// kLeastPressN and kLeastPressN. Pure.
PressCue press_cue(double force_n);

/// Lays it over the tissue around each finger that presses: whole where the fingertip touches, none from
/// twice a fingertip's radius off its middle. `node_colours` are (|V|), `displacement_m` (3 |V|). Of two
/// fingers the nearer one counts. Pure.
void colour_pressed_tissue(const sim::TetMesh& mesh, std::span<const double> displacement_m,
                           const HandForces::State& hand, std::span<sim::Rgb> node_colours);

/// The colour of a fingertip that presses so.
sim::Rgb with_cue(const sim::Rgb& colour, const PressCue& cue);

}  // namespace kiroku::trainer

// What a person does at the breathing workbench, as values (docs/reference/viewer.md, "Breathing"). Plain
// data.
#pragma once

#include <optional>

#include "sim/drr/overlay.h"
#include "sim/respiration/breathing.h"

namespace kiroku::viewer {

/// How both groups move, how long a breath of a sine is (nothing: as the model's waveform is), and which node
/// of the surface is of which group, in ascending order of the nodes (nothing: as the model has them).
struct MotionDeed {
  sim::BreathingMotion motion;
  std::optional<double> cycle_s;
  std::optional<sim::BoundaryGroups> surface_groups = {};
};
/// When it is looked at: s since the first radiograph, or of the waveform where there are none.
struct MomentDeed {
  double time_s = 0;
};
/// How lung and radiograph are shown; `part` as overlay_of() has its opacity.
struct LookDeed {
  sim::OverlayMode mode = sim::OverlayMode::kOpacity;
  double part = 0.5;
  bool outlined = true;
};

}  // namespace kiroku::viewer

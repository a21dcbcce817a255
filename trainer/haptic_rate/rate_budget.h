// What perception asks of the force loop, and what this machine gives: the more fingers, the lower the rate
// that is felt as continuous, and the more each force costs.
#pragma once

#include <chrono>

#include "sim/haptics/rate_scheduler.h"
#include "sim/render/surface_renderer.h"
#include "trainer/haptic_rate/plate.h"

namespace kiroku::trainer {

struct RateBudget {
  std::size_t fingers = 1;
  double required_hz = 0;
  double force_ms = 0;       // of one renewal of all fingers' forces, the median
  double achievable_hz = 0;  // if nothing else were computed
  sim::ScheduleReport
      schedule;  // forces at the required rate, deformation and pictures in between, one thread
};

/// Source: Table 2 of "Construction of Training Environment for Surgical Exclusion with a Basic Study of
/// Multi-finger Haptic Interaction": reaction forces on a cylinder of 820 vertices, on two Xeons of 2.6 GHz.
double paper_force_ms(std::size_t fingers);  // kiroku::UsageError for other than 1 to 5

/// The rate that the same study takes for required (its Figure 5): its means for one and two fingers
/// (section 6.1), a third for each further finger, as it assumes there. kiroku::UsageError for other than 1
/// to 5.
double exclusion_required_hz(std::size_t fingers);

/// Presses the plate with so many fingers for `time`: first forces alone, then as RateScheduler shares one
/// thread. Pictures of 640 x 480 by `renderer`, of the plate's mesh. Real time is what is measured.
RateBudget measure_budget(const Plate& plate, sim::SurfaceRenderer& renderer, std::size_t fingers,
                          double required_hz, std::chrono::nanoseconds time);

}  // namespace kiroku::trainer

#include "trainer/haptic_rate/rate_budget.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/error.h"
#include "trainer/haptic_rate/published_thresholds.h"

namespace kiroku::trainer {

using std::chrono::nanoseconds;

double paper_force_ms(std::size_t fingers) {
  constexpr std::array<double, kMostFingers> kMilliseconds{0.20, 0.63, 2.36, 8.18, 29.7};
  if (fingers < 1 || fingers > kMostFingers)
    throw UsageError("the paper measured 1 to 5 fingers, not " + std::to_string(fingers));
  return kMilliseconds[fingers - 1];
}

double exclusion_required_hz(std::size_t fingers) {
  constexpr std::size_t kMeasured = 2;
  const std::size_t measured = std::min(Fingers(fingers).count(), kMeasured);
  return *published_threshold_hz(RateSeries::kExclusion, measured) /
         std::pow(3.0, static_cast<double>(fingers - measured));
}

RateBudget measure_budget(const Plate& plate, sim::SurfaceRenderer& renderer, std::size_t fingers,
                          double required_hz, nanoseconds time) {
  const std::vector<sim::Pose> lightly = plate.pressing(fingers, kLeastPressN),
                               firmly = plate.pressing(fingers, kMostPressN);
  PlateForces contact(plate, lightly);
  std::vector<sim::Pose> poses = lightly;
  std::vector<sim::Vector3> forces_n(fingers);
  sim::MonotonicClock clock;
  const nanoseconds begun = clock.now();
  const auto press = [&] {
    const double seconds = std::chrono::duration<double>(clock.now() - begun).count();
    const double share = (1 - std::cos(2 * std::numbers::pi * seconds)) / 2;
    for (std::size_t i = 0; i < fingers; ++i)
      poses[i].position_m = lightly[i].position_m + share * (firmly[i].position_m - lightly[i].position_m);
    contact.forces(poses, 1 / required_hz, forces_n);
  };
  RateBudget budget;
  budget.fingers = fingers;
  budget.required_hz = required_hz;
  std::vector<double> took_ms;
  while (clock.now() - begun < time) {
    const nanoseconds before = clock.now();
    press();
    took_ms.push_back(std::chrono::duration<double, std::milli>(clock.now() - before).count());
  }
  const auto middle = took_ms.begin() + static_cast<std::ptrdiff_t>(took_ms.size() / 2);
  std::ranges::nth_element(took_ms, middle);
  budget.force_ms = *middle;
  budget.achievable_hz = 1000 / budget.force_ms;

  Eigen::VectorXd displacement_m;
  const auto deform = [&] { plate.contact().displacement_m(contact.result().contacts, displacement_m); };
  deform();
  sim::SurfaceScene scene;
  scene.camera =
      sim::camera_looking_at(sim::ball_around(plate.body().mesh()), {0, 50}, scene.width, scene.height, 1.2);
  const auto draw = [&] {
    (void)renderer.render({displacement_m.data(), static_cast<std::size_t>(displacement_m.size())}, scene);
  };
  budget.schedule = sim::RateScheduler(clock, {press, deform, draw}, required_hz).run(time);
  return budget;
}

}  // namespace kiroku::trainer

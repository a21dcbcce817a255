#include "trainer/exclusion/press_cue.h"

#include <algorithm>
#include <cmath>

#include "trainer/haptic_rate/plate.h"

namespace kiroku::trainer {

using sim::Vector3;

PressCue press_cue(double force_n) {
  constexpr double kBeginsN = kLeastPressN / 2;
  return {colour_of_press(force_n), std::clamp((force_n - kBeginsN) / (kLeastPressN - kBeginsN), 0.0, 1.0)};
}

sim::Rgb with_cue(const sim::Rgb& colour, const PressCue& cue) {
  sim::Rgb mixed{};
  for (std::size_t c = 0; c < mixed.size(); ++c) {
    mixed[c] =
        static_cast<std::uint8_t>(std::lround(cue.share * cue.colour[c] + (1 - cue.share) * colour[c]));
  }
  return mixed;
}

void colour_pressed_tissue(const sim::TetMesh& mesh, std::span<const double> displacement_m,
                           const HandForces::State& hand, std::span<sim::Rgb> node_colours) {
  constexpr double kReachMetres = 2 * kFingertipMetres;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    const Vector3 at_m = mesh.nodes[node] + Eigen::Map<const Vector3>(&displacement_m[3 * node]);
    double nearest_m = kReachMetres;
    PressCue cue;
    for (std::size_t finger = 0; finger < hand.poses.size(); ++finger) {
      const double distance_m = (at_m - hand.poses[finger].position_m).norm();
      if (distance_m >= nearest_m) continue;
      nearest_m = distance_m;
      cue = press_cue(hand.forces_n[finger].norm());
    }
    cue.share *= std::clamp((kReachMetres - nearest_m) / (kReachMetres - kFingertipMetres), 0.0, 1.0);
    if (cue.share > 0) node_colours[node] = with_cue(node_colours[node], cue);
  }
}

}  // namespace kiroku::trainer

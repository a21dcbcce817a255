#include "trainer/haptic_rate/plate_picture.h"

#include <algorithm>
#include <cmath>

namespace kiroku::trainer {
namespace {

using sim::Vector3;

constexpr sim::Rgb kTissueColour{214, 178, 160}, kFinger{235, 205, 180};

}  // namespace

std::vector<sim::Rgb> colours_of_touch(const Plate& plate, std::span<const sim::Pose> poses,
                                       std::span<const double> forces_n) {
  constexpr double kReachMetres = 0.02;
  std::vector<sim::Rgb> colours;
  for (const Vector3& node : plate.body().mesh().nodes) {
    double nearest_m = kReachMetres, force_n = 0;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const double distance_m = (node - poses[i].position_m).head<2>().norm();
      if (forces_n[i] > 0 && distance_m < nearest_m) {
        nearest_m = distance_m;
        force_n = forces_n[i];
      }
    }
    const sim::Rgb touched = colour_of_press(force_n);
    const double share = std::clamp(2 * (1 - nearest_m / kReachMetres), 0.0, 1.0);
    sim::Rgb& colour = colours.emplace_back();
    for (std::size_t c = 0; c < 3; ++c)
      colour[c] = static_cast<std::uint8_t>(std::lround(share * touched[c] + (1 - share) * kTissueColour[c]));
  }
  return colours;
}

sim::Picture picture_of_press(const Plate& plate, std::size_t fingers) {
  std::vector<sim::Pose> poses(fingers);
  // Each finger where all press with its force: nearly what they feel together.
  for (std::size_t i = 0; i < fingers; ++i) {
    const double share = fingers > 1 ? static_cast<double>(i) / static_cast<double>(fingers - 1) : 0;
    poses[i] = plate.pressing(fingers, kLeastPressN + share * (kMostPressN - kLeastPressN))[i];
  }
  PlateForces contact(plate, poses);
  std::vector<Vector3> on_fingers_n(fingers);
  contact.forces(poses, 1e-3, on_fingers_n);
  std::vector<double> forces_n;
  for (const Vector3& force_n : on_fingers_n) forces_n.push_back(force_n.norm());
  Eigen::VectorXd displacement_m;
  plate.contact().displacement_m(contact.result().contacts, displacement_m);
  sim::SurfaceScene scene;
  scene.camera =
      sim::camera_looking_at(sim::ball_around(plate.body().mesh()), {0, 50}, scene.width, scene.height, 1.2);
  scene.node_colours = colours_of_touch(plate, poses, forces_n);
  const std::vector<sim::ContactTool> tools = Plate::fingers(fingers);
  for (std::size_t i = 0; i < fingers; ++i)
    scene.solids.push_back({{tools[i].shape, poses[i], kFinger}, 1, true});
  sim::SurfaceRenderer renderer(plate.body().mesh(), sim::GpuUse::kOff);
  return renderer.render({displacement_m.data(), static_cast<std::size_t>(displacement_m.size())}, scene)
      .picture;
}

}  // namespace kiroku::trainer

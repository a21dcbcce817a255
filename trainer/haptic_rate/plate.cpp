#include "trainer/haptic_rate/plate.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "sim/mesh/tet_grid.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

constexpr double kSideMetres = 0.2, kThicknessMetres = 0.015, kFixedShare = 0.075;
constexpr std::array<std::uint32_t, 3> kCells{20, 20, 2};
constexpr sim::Material kTissue{0.2e6, 0.4, 1000};
constexpr double kFingerRadiusMetres = 0.008;
/// Where the fingertips of a right hand lie, thumb, index, middle, ring and little finger: above nodes, which
/// are 1 cm apart, as contact is at nodes.
constexpr std::array<std::array<double, 2>, kMostFingers> kPlaces{
    {{-0.04, -0.03}, {-0.03, 0.03}, {0, 0.04}, {0.03, 0.03}, {0.06, 0.01}}};

/// Above nodes, each. A number of fingers keeps its places; the hand of named ones and of one alone is moved
/// so that they lie around the plate's middle.
std::vector<Vector3> places_of(const Fingers& fingers) {
  constexpr double kNodesMetres = 0.01;
  std::vector<Vector3> places;
  Vector3 middle = Vector3::Zero();
  for (const Finger finger : fingers.which()) {
    const auto& place = kPlaces.at(static_cast<std::size_t>(finger));
    places.emplace_back(place[0], place[1], kFingerRadiusMetres);
    middle += Vector3(place[0], place[1], 0) / static_cast<double>(fingers.count());
  }
  if (!fingers.named() && fingers.count() > 1) return places;
  const Vector3 whole = (middle / kNodesMetres).array().round() * kNodesMetres;
  for (Vector3& place : places) place -= whole;
  return places;
}

/// Nodes of the surface that fingers at these places may come to touch.
std::vector<std::uint32_t> places_near(const sim::ContactBody& body, std::span<const sim::Pose> poses) {
  constexpr double kReachMetres = 0.025;
  std::vector<std::uint32_t> places;
  for (std::uint32_t place = 0; place < body.surface().size(); ++place) {
    const Vector3& node = body.body().mesh().nodes[body.surface()[place]];
    const auto near = [&](const sim::Pose& pose) {
      return (node - pose.position_m).head<2>().norm() < kReachMetres;
    };
    if (node.z() > -kThicknessMetres / 4 && std::ranges::any_of(poses, near)) places.push_back(place);
  }
  return places;
}

}  // namespace

Plate::Plate() {
  sim::TetMesh mesh = sim::tet_grid(kCells, {kSideMetres, kSideMetres, kThicknessMetres});
  for (Vector3& node : mesh.nodes) node -= Vector3(kSideMetres / 2, kSideMetres / 2, kThicknessMetres);
  sim::Constraints constraints(mesh.nodes.size());
  const double free_m = (0.5 - kFixedShare) * kSideMetres;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (std::abs(mesh.nodes[node].x()) > free_m)
      constraints.prescribe(node, Vector3::Zero(), "the plate's ends");
  }
  body_ = std::make_unique<sim::ElasticBody>(std::move(mesh), sim::Materials{{0, kTissue}},
                                             std::move(constraints));
  contact_ = std::make_unique<sim::ContactBody>(*body_);
}

std::vector<sim::ContactTool> Plate::fingers(std::size_t count, bool stick) {
  (void)Fingers(count);
  std::vector<sim::ContactTool> tools;
  for (std::size_t i = 0; i < count; ++i)
    tools.push_back({"finger " + std::to_string(i + 1), sim::Sphere{kFingerRadiusMetres}, stick});
  return tools;
}

std::vector<sim::Pose> Plate::pressing(const Fingers& fingers, double force_n) const {
  const std::size_t count = fingers.count();
  std::vector<sim::Pose> poses(count);
  for (std::size_t i = 0; const Vector3& place : places_of(fingers)) poses[i++].position_m = place;
  if (force_n <= 0) return poses;
  PlateForces contact(*this, poses);
  std::vector<Vector3> forces_n(count);
  // The plate under one finger is at least so stiff; each finger goes deeper by what its force lacks, until
  // it has it beside the others.
  constexpr double kStepMetresPerNewton = 4e-4, kAgreement = 1e-3;
  constexpr int kMostSteps = 2000;
  for (int step = 0; step < kMostSteps; ++step) {
    contact.forces(poses, 1e-3, forces_n);
    double worst_n = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const double lacks_n = force_n - forces_n[i].z();
      poses[i].position_m.z() -= kStepMetresPerNewton * lacks_n;
      worst_n = std::max(worst_n, std::abs(lacks_n));
    }
    if (worst_n <= kAgreement * force_n) return poses;
  }
  throw Error("no places were found at which " + fingers.in_words() + " press the plate with " +
              std::to_string(force_n) + " N each; presses of 0.5 to 1 N are meant");
}

sim::Rgb colour_of_press(double force_n) {
  const double share = std::clamp((force_n - kLeastPressN) / (kMostPressN - kLeastPressN), 0.0, 1.0);
  const auto part = [](double value) { return static_cast<std::uint8_t>(std::lround(255 * value)); };
  return {part(share), 0, part(1 - share)};
}

PlateForces::PlateForces(const Plate& plate, std::span<const sim::Pose> poses, bool stick)
    : solver_(plate.contact().neighbourhood(places_near(plate.contact(), poses)),
              Plate::fingers(poses.size(), stick), {1e-6, 20}) {}

void PlateForces::forces(std::span<const sim::Pose> poses, double /*period_s*/, std::span<Vector3> forces_n) {
  const sim::ContactResult& result = solver_.step(poses);
  for (std::size_t i = 0; i < forces_n.size(); ++i) forces_n[i] = result.tools[i].force_n;
}

}  // namespace kiroku::trainer

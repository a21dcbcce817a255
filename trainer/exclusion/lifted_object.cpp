#include "trainer/exclusion/lifted_object.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "base/error.h"
#include "trainer/exclusion/hand_forces.h"
#include "trainer/exclusion/stress_score.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

std::vector<double> sides_m(std::size_t fingers, LiftManner manner) {
  const std::span<const double> spread_m = side_by_side_m(fingers);
  std::vector<double> found(spread_m.begin(), spread_m.end());
  if (manner == LiftManner::kSpread) return found;
  constexpr double kApartMetres = 2 * kFingertipMetres + 0.001;
  for (std::size_t i = 0; i < fingers; ++i)
    found[i] = kApartMetres * (static_cast<double>(i) - (static_cast<double>(fingers) - 1) / 2);
  return found;
}

}  // namespace

std::string name_of(LiftManner manner) { return manner == LiftManner::kSpread ? "spread" : "together"; }

LiftedObject lift_border(const sim::ContactBody& contact, const ExclusionTask& task, std::size_t fingers,
                         LiftManner manner, double height_m) {
  constexpr double kMostMetres = 0.05, kStepMetres = 5e-4, kReachMetres = 0.03, kShareAbove95 = 0.05;
  if (!(height_m > 0 && height_m <= kMostMetres))
    throw UsageError("a border is lifted by more than 0 and at most 5 cm");
  const sim::ElasticBody& body = contact.body();
  LiftedObject found;
  for (const double side_m : sides_m(fingers, manner)) {
    found.poses.emplace_back();
    found.poses.back().position_m = task.under_border_m + side_m * task.aside;
  }
  std::vector<std::uint32_t> places;
  for (std::uint32_t place = 0; place < contact.surface().size(); ++place) {
    const Vector3& node = body.mesh().nodes[contact.surface()[place]];
    if (std::ranges::any_of(found.poses, [&](const sim::Pose& pose) {
          const Vector3 from = node - pose.position_m;
          return (from - from.dot(task.lifts) * task.lifts).norm() < kReachMetres;
        }))
      places.push_back(place);
  }
  sim::ContactSolver solver(contact.neighbourhood(places), fingertips(fingers, task.friction));
  const auto steps = static_cast<int>(std::ceil(height_m / kStepMetres));
  for (int step = 0; step < steps; ++step) {
    for (sim::Pose& pose : found.poses) pose.position_m += height_m / steps * task.lifts;
    solver.step(found.poses);
  }
  for (const sim::ToolForce& tool : solver.result().tools) found.forces_n.push_back(tool.force_n.norm());
  found.wrist_n = solver.result().wrist_force_n.norm();
  contact.displacement_m(solver.result().contacts, found.displacement_m);
  found.stress_pa = body.stress_pa(found.displacement_m);
  std::vector<double> volumes_m3;
  for (std::size_t t = 0; t < found.stress_pa.size(); ++t) {
    volumes_m3.push_back(sim::signed_volume_m3(body.mesh(), t));
    const double pa = sim::von_mises(found.stress_pa[t]);
    if (pa <= found.largest_von_mises_pa) continue;
    found.largest_von_mises_pa = pa;
    found.largest_at = t;
  }
  const std::vector<sim::SymmetricTensor> at_nodes_pa = body.at_nodes(found.stress_pa);
  for (const sim::SymmetricTensor& stress_pa : at_nodes_pa)
    found.von_mises_at_nodes_pa.push_back(sim::von_mises(stress_pa));
  found.high_von_mises_pa = stress_of_share_pa(body.mesh(), volumes_m3, at_nodes_pa);
  found.von_mises_95_pa = stress_of_share_pa(body.mesh(), volumes_m3, at_nodes_pa, kShareAbove95);
  return found;
}

StressPeak peak_away(const sim::TetMesh& mesh, const LiftedObject& lifted) {
  constexpr double kAwayMetres = 0.035, kFreeMetres = 0.075;
  StressPeak found;
  for (std::size_t t = 0; t < lifted.stress_pa.size(); ++t) {
    Vector3 middle = Vector3::Zero();
    for (const std::uint32_t node : mesh.tetrahedra[t]) middle += mesh.nodes[node] / 4;
    const bool touched = std::ranges::any_of(
        lifted.poses, [&](const sim::Pose& pose) { return (middle - pose.position_m).norm() < kAwayMetres; });
    if (touched || std::abs(middle.x()) > kFreeMetres) continue;
    const double pa = sim::von_mises(lifted.stress_pa[t]);
    if (pa > found.von_mises_pa) found = {pa, t, middle};
  }
  return found;
}

std::vector<bool> at_interface(const sim::TetMesh& mesh, const sim::Materials& materials) {
  std::map<std::array<std::uint32_t, 3>, std::size_t> first_at;
  std::vector<bool> found(mesh.tetrahedra.size());
  const auto stiffness_pa = [&](std::size_t t) { return materials.at(mesh.regions[t]).young_modulus_pa; };
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (std::size_t left_out = 0; left_out < 4; ++left_out) {
      std::array<std::uint32_t, 3> face{};
      for (std::size_t a = 0, i = 0; a < 4; ++a) {
        if (a != left_out) face[i++] = mesh.tetrahedra[t][a];
      }
      std::ranges::sort(face);
      const auto [other, is_new] = first_at.try_emplace(face, t);
      if (is_new || stiffness_pa(other->second) == stiffness_pa(t)) continue;
      found[t] = found[other->second] = true;
    }
  }
  return found;
}

}  // namespace kiroku::trainer

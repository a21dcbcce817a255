#include "sim/render/plan_pictures.h"

#include <cmath>
#include <utility>

#include "sim/fem/element.h"
#include "sim/render/plan_scene.h"

namespace kiroku::sim {
namespace {

std::vector<double> von_mises_of(const PlanFrame& frame) {
  std::vector<double> stress_pa;
  stress_pa.reserve(frame.stress_pa.size());
  for (const SymmetricTensor& stress : frame.stress_pa) stress_pa.push_back(von_mises(stress));
  return stress_pa;
}

/// A fifth of the edge of a regular tetrahedron as large as the mesh's are on average.
double contact_radius_m(const TetMesh& mesh) {
  constexpr double kShareOfEdge = 0.2;
  double volume_m3 = 0;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) volume_m3 += signed_volume_m3(mesh, t);
  return kShareOfEdge * std::cbrt(volume_m3 * 6 * std::sqrt(2.0) / double(mesh.tetrahedra.size()));
}

}  // namespace

Ball view_of_plan(const Plan& plan) {
  constexpr double kRoom = 1.1;
  Ball ball = ball_around(plan.body.mesh);
  ball.radius_m *= kRoom;
  return ball;
}

PlanPictures::PlanPictures(const Plan& plan, std::shared_ptr<const ShadedVolume> volume,
                           const TransferFunction& transfer, const EngineChoice& choice, Scene scene,
                           PlanPictureOptions options)
    : plan_(plan),
      scene_(std::move(scene)),
      options_(options),
      renderer_(std::move(volume), transfer, choice),
      contact_radius_m_(contact_radius_m(plan.body.mesh)) {}

void PlanPictures::set_size(int width, int height, double spacing_m, bool moving) {
  scene_.width = width;
  scene_.height = height;
  scene_.spacing_m = spacing_m;
  scene_.moving = moving;
}

Picture PlanPictures::picture(const PlanFrame& frame, const TetMesh& mesh) {
  // Cuts take tetrahedra out and move nodes; nothing else changes the mesh.
  if (mesh.tetrahedra.size() != shown_.tetrahedra.size() || mesh.nodes != shown_.nodes) {
    shown_ = mesh;
    renderer_.set_mesh(shown_);
  }
  scene_.solids = tools_of(plan_, frame);
  if (options_.contacts) {
    const std::vector<Solid> points = contact_points_of(mesh, frame, contact_radius_m_);
    scene_.solids.insert(scene_.solids.end(), points.begin(), points.end());
  }
  scene_.stress.reset();
  if (options_.largest_pa) {
    scene_.stress.emplace();
    scene_.stress->largest_pa = *options_.largest_pa;
    scene_.stress->at_nodes_pa = at_nodes(mesh, von_mises_of(frame));
  }
  return renderer_.render(
      {frame.displacement_m.data(), static_cast<std::size_t>(frame.displacement_m.size())}, scene_);
}

}  // namespace kiroku::sim

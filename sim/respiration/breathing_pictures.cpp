#include "sim/respiration/breathing_pictures.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>

#include "sim/mesh/degrees_of_freedom.h"

namespace kiroku::sim {
namespace {

std::vector<Vector3> nodes_of(const Eigen::VectorXd& vectors) {
  std::vector<Vector3> nodes;
  for (Eigen::Index at = 0; at < vectors.size(); at += 3) nodes.emplace_back(vectors.segment<3>(at));
  return nodes;
}

}  // namespace

BreathingScene::BreathingScene(const BreathingModel& model, const Volume& volume)
    : BreathingScene(model, std::make_shared<CtProjector>(volume, Attenuation(Attenuation::kCtEnergyKev))) {}

BreathingScene::BreathingScene(const BreathingModel& model, const std::shared_ptr<const CtProjector>& ct)
    : BreathingScene(model, ct, std::make_shared<MeshProjector>(*ct, model.mesh)) {}

BreathingScene::BreathingScene(const BreathingModel& model, std::shared_ptr<const CtProjector> ct,
                               std::shared_ptr<const MeshProjector> mesh)
    : ct_(std::move(ct)),
      mesh_(std::move(mesh)),
      body_(std::make_unique<BreathingBody>(model.mesh, model.materials, model.groups, model.slide)),
      rib_cage_(nodes_of(body_->response(BoundaryGroup::kRibCage, model.motion.rib_cage.direction))) {
  const Extent extent = extent_of(model.mesh);
  middle_m_ = (extent.least + extent.greatest) / 2;
  if (model.motion.diaphragm.direction) {
    point_diaphragm(*model.motion.diaphragm.direction);
  } else {
    diaphragm_ = nodes_of(body_->response(BoundaryGroup::kDiaphragm, std::nullopt));
  }
}

std::array<Vector3, 2> BreathingScene::across_diaphragm() const {
  const Vector3 first = direction_->unitOrthogonal();
  return {first, direction_->cross(first)};
}

void BreathingScene::point_diaphragm(const Vector3& direction) {
  direction_ = direction.normalized();
  diaphragm_ = nodes_of(body_->response(BoundaryGroup::kDiaphragm, direction_));
  const std::array<Vector3, 2> axes = across_diaphragm();
  for (std::size_t i = 0; i < axes.size(); ++i)
    across_[i] = nodes_of(body_->response(BoundaryGroup::kDiaphragm, axes[i]));
}

std::vector<Vector3> BreathingScene::displacement_m(const BreathState& state,
                                                    const std::array<double, 2>& across_m) const {
  std::vector<Vector3> displacement_m(rib_cage_.size());
  for (std::size_t node = 0; node < displacement_m.size(); ++node) {
    displacement_m[node] = state.rib_cage_m * rib_cage_[node] + state.diaphragm_m * diaphragm_[node];
    for (std::size_t i = 0; i < across_m.size(); ++i) {
      if (across_m[i] != 0) displacement_m[node] += across_m[i] * across_[i][node];
    }
  }
  return displacement_m;
}

Vector3 BreathingScene::response(BoundaryGroup group, const MeshPoint& place) const {
  return place.mean(group == BoundaryGroup::kRibCage ? rib_cage_ : diaphragm_);
}

StateAxis StateAxis::covering(double from_m, double to_m, double step_m) {
  StateAxis axis;
  const double steps = std::max(std::ceil((to_m - from_m) / step_m), 1.0);
  axis.step_m = std::max((to_m - from_m) / steps, 1e-4);
  axis.least_m = from_m - axis.step_m;
  axis.count = static_cast<std::size_t>(steps) + 3;
  return axis;
}

StateAxis::Blend StateAxis::at(double value_m) const {
  const double place = (std::clamp(value_m, from_m(), to_m()) - least_m) / step_m;
  Blend blend;
  blend.first = std::clamp<std::size_t>(static_cast<std::size_t>(place), 1, count - 3) - 1;
  const double f = place - static_cast<double>(blend.first + 1), f2 = f * f, f3 = f2 * f;
  blend.weight = {-0.5 * f + f2 - 0.5 * f3, 1 - 2.5 * f2 + 1.5 * f3, 0.5 * f + 2 * f2 - 1.5 * f3,
                  -0.5 * f2 + 0.5 * f3};
  blend.slope = {-0.5 + 2 * f - 1.5 * f2, -5 * f + 4.5 * f2, 0.5 + 4 * f - 4.5 * f2, -f + 1.5 * f2};
  for (double& slope : blend.slope) slope /= step_m;
  return blend;
}

BreathingPictures::BreathingPictures(const BreathingScene& scene, const ProjectionGeometry& geometry,
                                     const StateAxis& rib_cage, const StateAxis& diaphragm)
    : rib_cage_(rib_cage), diaphragm_(diaphragm), columns_(geometry.columns()), rows_(geometry.rows()) {
  const ProjectionImage still = scene.still(geometry);
  for (std::size_t i = 0; i < rib_cage.count; ++i) {
    for (std::size_t j = 0; j < diaphragm.count; ++j) {
      ProjectionImage image = scene.moving(geometry, {rib_cage.node(i), diaphragm.node(j)});
      add_to(image, still);
      images_.push_back(std::move(image.values));
    }
  }
}

void BreathingPictures::look_up(const BreathState& state, Looked& looked) const {
  const StateAxis::Blend r = rib_cage_.at(state.rib_cage_m), d = diaphragm_.at(state.diaphragm_m);
  const std::size_t size = columns_ * rows_;
  for (std::vector<float>* const image : {&looked.value, &looked.by_rib_cage, &looked.by_diaphragm})
    image->assign(size, 0.0F);
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < 4; ++j) {
      const float* const from = at_node(r.first + i, d.first + j).data();
      const auto value = static_cast<float>(r.weight[i] * d.weight[j]),
                 by_r = static_cast<float>(r.slope[i] * d.weight[j]),
                 by_d = static_cast<float>(r.weight[i] * d.slope[j]);
      float *const to = looked.value.data(), *const to_r = looked.by_rib_cage.data(),
                   *const to_d = looked.by_diaphragm.data();
      for (std::size_t at = 0; at < size; ++at) {
        to[at] += value * from[at];
        to_r[at] += by_r * from[at];
        to_d[at] += by_d * from[at];
      }
    }
  }
}

}  // namespace kiroku::sim

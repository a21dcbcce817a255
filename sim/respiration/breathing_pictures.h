// What a breathing lung looks like on radiographs, for a fit: a table of DRRs over how far rib cage and
// diaphragm have moved, with a smooth curve between them, so that a series of hundreds of pictures needs some
// dozens of DRRs and the derivative by both motions is that of the curve.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "sim/drr/mesh_projector.h"
#include "sim/respiration/breathing_model.h"

namespace kiroku::sim {

/// How far rib cage and diaphragm have moved along their directions.
struct BreathState {
  double rib_cage_m = 0, diaphragm_m = 0;
};

/// A CT with the lung that moves in it. Not thread-safe; projections use all threads. Model and volume need
/// not outlive it, projectors are shared.
class BreathingScene {
 public:
  /// What BreathingBody, CtProjector and MeshProjector throw.
  BreathingScene(const BreathingModel& model, const Volume& volume);
  /// The same with projectors that are there already: of the CT, and of the model's mesh in it.
  BreathingScene(const BreathingModel& model, std::shared_ptr<const CtProjector> ct,
                 std::shared_ptr<const MeshProjector> mesh);

  [[nodiscard]] const TetMesh& mesh() const { return mesh_->mesh(); }
  [[nodiscard]] const CtProjector& ct() const { return *ct_; }
  /// Of the lung's box at rest: what a patient is turned about.
  [[nodiscard]] const Vector3& middle_m() const { return middle_m_; }

  /// Where the diaphragm goes; of length 1. The directions across it are those that can be sought.
  void point_diaphragm(const Vector3& direction);
  [[nodiscard]] const std::optional<Vector3>& diaphragm_direction() const { return direction_; }
  [[nodiscard]] std::array<Vector3, 2> across_diaphragm() const;

  /// (|V|), m. `across_m`: of the diaphragm along across_diaphragm().
  [[nodiscard]] std::vector<Vector3> displacement_m(const BreathState& state,
                                                    const std::array<double, 2>& across_m = {}) const;
  /// What a group's motion by 1 m does to a place of the mesh.
  [[nodiscard]] Vector3 response(BoundaryGroup group, const MeshPoint& place) const;

  /// The whole at rest, what stays, and what moves; see MeshProjector.
  [[nodiscard]] ProjectionImage at_rest(const ProjectionGeometry& geometry) const {
    return ct_->project(geometry);
  }
  [[nodiscard]] ProjectionImage still(const ProjectionGeometry& geometry) const {
    return mesh_->outside(geometry);
  }
  [[nodiscard]] ProjectionImage moving(const ProjectionGeometry& geometry, const BreathState& state,
                                       const std::array<double, 2>& across_m = {}) const {
    return mesh_->inside(geometry, displacement_m(state, across_m));
  }

 private:
  BreathingScene(const BreathingModel& model, const std::shared_ptr<const CtProjector>& ct);

  std::shared_ptr<const CtProjector> ct_;
  std::shared_ptr<const MeshProjector> mesh_;
  std::unique_ptr<BreathingBody> body_;
  Vector3 middle_m_ = Vector3::Zero();
  std::optional<Vector3> direction_;
  std::vector<Vector3> rib_cage_, diaphragm_;   // responses, (|V|)
  std::array<std::vector<Vector3>, 2> across_;  // (|V|), empty where the diaphragm follows its normals
};

/// The nodes of a table along one axis.
struct StateAxis {
  double least_m = 0, step_m = 1;
  std::size_t count = 4;  // four at least

  /// Covers [from, to] with steps of at most `step_m`, and one more node on each side.
  static StateAxis covering(double from_m, double to_m, double step_m);
  [[nodiscard]] double node(std::size_t i) const { return least_m + step_m * static_cast<double>(i); }
  /// Between these a state is looked up; others count as the nearer end.
  [[nodiscard]] double from_m() const { return node(1); }
  [[nodiscard]] double to_m() const { return node(count - 2); }

  /// Four nodes and what each counts for (Catmull and Rom's cubic), with the change of that a metre.
  struct Blend {
    std::size_t first = 0;
    std::array<double, 4> weight{}, slope{};
  };
  [[nodiscard]] Blend at(double value_m) const;
};

/// DRRs of one view over the states. Immutable, thread-safe.
class BreathingPictures {
 public:
  BreathingPictures(const BreathingScene& scene, const ProjectionGeometry& geometry,
                    const StateAxis& rib_cage, const StateAxis& diaphragm);

  struct Looked {
    std::vector<float> value, by_rib_cage, by_diaphragm;  // derivatives a metre
  };
  /// The picture of a state, and how it changes.
  void look_up(const BreathState& state, Looked& looked) const;
  [[nodiscard]] const StateAxis& rib_cage() const { return rib_cage_; }
  [[nodiscard]] const StateAxis& diaphragm() const { return diaphragm_; }
  /// Of the nodes.
  [[nodiscard]] const std::vector<float>& at_node(std::size_t rib_cage, std::size_t diaphragm) const {
    return images_[rib_cage * diaphragm_.count + diaphragm];
  }
  [[nodiscard]] std::size_t columns() const { return columns_; }
  [[nodiscard]] std::size_t rows() const { return rows_; }

 private:
  StateAxis rib_cage_, diaphragm_;
  std::size_t columns_, rows_;
  std::vector<std::vector<float>> images_;
};

}  // namespace kiroku::sim

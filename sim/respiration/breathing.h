// A lung that is moved by rib cage and diaphragm.
//
// Source: "Simulating Lung Tumor Motion for Dynamic Tumor-tracking Irradiation": at time t a vertex of the
// rib cage is displaced by dv_i = a_r sin 2 pi f (t + w_r) n_i, one of the diaphragm by dv_j = a_d sin 2 pi f
// (t + w_d) n_j; the trachea is fixed, the back slides in one direction only; what is inside follows by
// linear elasticity.
//
// As that is linear, the lung's displacement is sum over groups of a s(t + w) B, B what a group's motion by
// one metre displaces all nodes by: solved for once, on one factor.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "sim/fem/elastic_body.h"
#include "sim/respiration/boundary_groups.h"
#include "sim/respiration/waveform.h"

namespace kiroku::sim {

/// Lung, and the tumour in it (the source's section on material parameters).
inline constexpr Material kLungTissue{1e4, 0.25, 300};
inline constexpr Material kTumourTissue{1e6, 0.25, 1000};

/// How one group moves.
struct GroupMotion {
  double amplitude_m = 0;
  double phase_s = 0;                // w: so much earlier than the waveform
  std::optional<Vector3> direction;  // of length 1, for all its nodes; absent: each along its outward normal
  double baseline_m = 0;             // moved so far where the waveform is zero, at the time zero
  double drift_m_per_s = 0;          // how fast that baseline moves

  [[nodiscard]] double moved_m(const Waveform& waveform, double time_s) const {
    return amplitude_m * waveform.at(time_s + phase_s) + baseline_m + drift_m_per_s * time_s;
  }
};

struct BreathingMotion {
  GroupMotion rib_cage{0.003, 0, std::nullopt, 0, 0};
  GroupMotion diaphragm{0.01, 0.6, std::nullopt, 0, 0};
};

/// A lung held and moved at its groups, factorised. Not thread-safe.
class BreathingBody {
 public:
  /// `slide` is the direction of length 1 that nodes of the back are free in. What ElasticBody throws.
  BreathingBody(TetMesh mesh, const Materials& materials, const BoundaryGroups& groups, const Vector3& slide);

  [[nodiscard]] const ElasticBody& body() const { return *body_; }
  [[nodiscard]] const LungSurface& surface() const { return surface_; }
  [[nodiscard]] const BoundaryGroups& groups() const { return groups_; }

  /// What all nodes are displaced by, (3 |V|), where the group (kRibCage or kDiaphragm) moves by 1 m along
  /// `direction`, or along its outward normals where that is absent; the other group stays.
  [[nodiscard]] Eigen::VectorXd response(BoundaryGroup group, const std::optional<Vector3>& direction) const;

 private:
  LungSurface surface_;
  BoundaryGroups groups_;
  std::unique_ptr<ElasticBody> body_;
};

/// Where the lung is at any time. Immutable, thread-safe.
class BreathingCycle {
 public:
  BreathingCycle(const BreathingBody& body, const BreathingMotion& motion, Waveform waveform);

  [[nodiscard]] const Waveform& waveform() const { return waveform_; }
  /// (3 |V|), m, from the rest shape.
  [[nodiscard]] Eigen::VectorXd displacement_m(double time_s) const;
  /// How far rib cage and diaphragm have moved along their directions.
  [[nodiscard]] double rib_cage_m(double time_s) const { return motion_.rib_cage.moved_m(waveform_, time_s); }
  [[nodiscard]] double diaphragm_m(double time_s) const {
    return motion_.diaphragm.moved_m(waveform_, time_s);
  }

 private:
  BreathingMotion motion_;
  Waveform waveform_;
  Eigen::VectorXd rib_cage_, diaphragm_;  // responses
};

}  // namespace kiroku::sim

// A lung's answer to every motion of its groups, solved for beforehand: as the body is linear, whatever
// amplitudes, phases, directions, baselines and waveform are chosen, where the lung is then is a sum.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "sim/respiration/breathing.h"
#include "sim/respiration/mesh_point.h"

namespace kiroku::sim {

/// Rib cage and diaphragm, each by 1 m along x, y, z and along its outward normals.
inline constexpr std::size_t kUnitMotions = 8;

/// Parts of the unit motions that make up a motion at a time.
std::array<double, kUnitMotions> parts_of(const BreathingMotion& motion, const Waveform& waveform,
                                          double time_s);

/// kiroku::Error in one sentence where rib cage or diaphragm has no node.
void require_moved(const BoundaryGroups& groups);

/// Immutable, thread-safe.
class MotionResponses {
 public:
  /// Solves for all unit motions, on the body's factor. What require_moved() throws. `solved` hears how many
  /// of kUnitMotions are there.
  explicit MotionResponses(const BreathingBody& body, const std::function<void(std::size_t)>& solved = {});

  /// What each node is displaced by, (|V|), m, as BreathingCycle::displacement_m() is.
  [[nodiscard]] std::vector<Vector3> displacement_m(const BreathingMotion& motion, const Waveform& waveform,
                                                    double time_s) const;

  /// Of one place of the mesh, which is a sum of eight vectors.
  class Place {
   public:
    [[nodiscard]] Vector3 displacement_m(const BreathingMotion& motion, const Waveform& waveform,
                                         double time_s) const;

   private:
    friend class MotionResponses;
    std::array<Vector3, kUnitMotions> unit_;
  };
  [[nodiscard]] Place at(const MeshPoint& point) const;

 private:
  std::array<Eigen::VectorXd, kUnitMotions> unit_;  // (3 |V|)
};

}  // namespace kiroku::sim

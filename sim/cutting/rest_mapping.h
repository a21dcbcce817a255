// Between the deformed body, where a blade is seen to move, and the rest shape, which is what is cut.
#pragma once

#include <vector>

#include "sim/cutting/sweep_surface.h"
#include "sim/cutting/vertex_preserving_cut.h"

namespace kiroku::sim {

/// A point inside goes with the tetrahedron it is in (the first, where the deformed body overlaps itself);
/// one outside goes as the nearest point of the surface does, so that the mapping has no jump there. Between
/// two poses the blade's sweep is straight in the rest shape, not in the deformed one: where the deformation
/// is large, poses must be close. Immutable, thread-safe; takes one pass over the tetrahedra for each point.
class RestMapping {
 public:
  /// `displacement_m` (3 |V|). `shape` must outlive it and not be cut meanwhile. kiroku::Error for a
  /// displacement of another size or one that is not finite.
  RestMapping(const VertexPreservingCut& shape, const Eigen::VectorXd& displacement_m);

  [[nodiscard]] Vector3 to_rest(const Vector3& deformed_m) const;
  [[nodiscard]] BladePose to_rest(const BladePose& deformed) const {
    return {to_rest(deformed.tip), to_rest(deformed.heel)};
  }
  /// The way back.
  [[nodiscard]] Vector3 to_deformed(const Vector3& rest_m) const;
  [[nodiscard]] BladePose to_deformed(const BladePose& rest) const {
    return {to_deformed(rest.tip), to_deformed(rest.heel)};
  }

 private:
  [[nodiscard]] Vector3 mapped(const Vector3& point_m, const std::vector<Vector3>& from_m,
                               const std::vector<Vector3>& to_m) const;

  const VertexPreservingCut& shape_;
  std::vector<Vector3> deformed_m_;  // (|V|)
  std::vector<Face> surface_;
};

}  // namespace kiroku::sim

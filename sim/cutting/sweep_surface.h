// The surface that a blade's edge sweeps between two poses, and what it meets. Immutable, thread-safe.
//
// Source: S_t of "Interactive Volume Manipulation for Supporting Preoperative Planning". The four ends of the
// edge need not lie in one plane: the surface is two triangles that share the diagonal from the first tip to
// the second heel.
//
// What lies on it. A distance below kTouch of the lengths involved counts as none, so that rounding decides
// nothing. A point on it counts as being before it (on the side its normals point to): what touches it
// exactly is cut on one side of it and never on both. The edge the sweep begins with belongs to it, the edge
// it ends with and its two lateral borders do not: a sweep that begins where the last one ended leaves no
// line uncut and cuts none twice, and one that only grazes a point leaves it whole.
#pragma once

#include <array>
#include <cstdint>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// The cutting edge of a blade, straight, from its tip to its heel; m.
struct BladePose {
  Vector3 tip = Vector3::Zero(), heel = Vector3::Zero();
};

class SweepSurface {
 public:
  static constexpr double kTouch = 1e-12;

  /// kiroku::UsageError in one sentence for poses that are not finite, an edge without length, and an edge
  /// that does not move or only along itself: such a blade has no surface.
  SweepSurface(const BladePose& from, const BladePose& to);

  [[nodiscard]] const BladePose& from() const { return from_; }
  [[nodiscard]] const BladePose& to() const { return to_; }
  [[nodiscard]] const Extent& extent() const { return extent_; }
  [[nodiscard]] double area_m2() const;

  /// Where the segment from a to b goes through it: 1 from before to behind, -1 from behind to before, 0 not
  /// at all. crossing(b, a) is -crossing(a, b).
  [[nodiscard]] int crossing(const Vector3& a, const Vector3& b) const;

  struct Nearest {
    Vector3 point, normal;  // of unit length, of the triangle(s) the point is on
  };
  /// The point of the surface (its border included) that is nearest.
  [[nodiscard]] Nearest nearest(const Vector3& point) const;

 private:
  struct Triangle {
    std::array<Vector3, 3> corners;
    std::array<bool, 3> side_belongs;  // from corner i to the next
    Vector3 normal;
    bool flat;  // three corners on one line: a tip or heel that stays where it is
  };
  BladePose from_, to_;
  std::array<Triangle, 2> triangles_;
  Extent extent_;
};

}  // namespace kiroku::sim

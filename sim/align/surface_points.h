// Points of the organ's surface, fixed to it where they were first seen, and followed through the pictures by
// optical flow. An object belongs to one thread.
//
// Source: Lucas and Kanade with pyramids (Bouguet, "Pyramidal Implementation of the Lucas Kanade Feature
// Tracker", 2000); points are checked by following them back (Kalal, Mikolajczyk and Matas, "Forward-Backward
// Error", ICPR 2010).
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "sim/align/outline_fit.h"

namespace kiroku::sim {

/// Where the points say the organ is.
struct PointsFit {
  Expected expected;
  std::size_t points = 0;  // that agree
  double share = 0;        // of those that were followed
  double misfit_px = 0;    // root of the mean square of those that agree
};

class SurfacePoints {
 public:
  SurfacePoints();
  ~SurfacePoints();
  SurfacePoints(const SurfacePoints&) = delete;
  SurfacePoints& operator=(const SurfacePoints&) = delete;

  /// Follows the points into the next picture, of the same size; the first, and one after drop(), is only
  /// kept. A point that comes under cover is given up.
  void follow(const Picture& picture, const Cover& cover);
  /// Fits a camera to the points in the picture that follow() took last. Nothing for fewer than kLeastPoints
  /// that agree. The covariance is what the organ's place had where the points were fixed, and what the
  /// points leave open since then.
  [[nodiscard]] std::optional<PointsFit> fit(const OrganSurface& surface, const Pinhole& pinhole) const;
  /// Fixes other points to the organ that this camera sees in the picture that follow() took last.
  void fix(const OrganSurface& surface, const Pinhole& pinhole, const Expected& place);
  /// Whether too few are left of those that were fixed, or they have been followed for long.
  [[nodiscard]] bool worn() const;
  void drop();
  /// Those that are followed, in the picture that follow() took last.
  struct Followed {
    Vector3 organ_m;        // where it was fixed to the organ
    Eigen::Vector2d pixel;  // where it is now
  };
  [[nodiscard]] std::vector<Followed> followed() const;

  static constexpr std::size_t kLeastPoints = 12;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::sim

// Picked points carried from picture to picture by optical flow. An object belongs to one thread.
//
// Source: Lucas and Kanade with pyramids (Bouguet, "Pyramidal Implementation of the Lucas Kanade Feature
// Tracker", 2000); points are checked by following them back (Kalal, Mikolajczyk and Matas, "Forward-Backward
// Error", ICPR 2010).
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "media/png.h"

namespace kiroku::compare {

class PointHold {
 public:
  /// Points in the first picture; pixels as of PickedPoint (registration.h).
  PointHold(const media::PictureView& picture, std::span<const Eigen::Vector2d> points);
  ~PointHold();
  PointHold(const PointHold&) = delete;
  PointHold& operator=(const PointHold&) = delete;

  /// Follows the points into the next picture. One is lost, for good, where it leaves the picture, nothing
  /// around it could tell where it went, or followed back it does not come out within a pixel of where it
  /// was. Throws kiroku::Error for a picture of another size.
  void follow(const media::PictureView& picture);
  /// Loses a point, for good.
  void drop(std::size_t point) { points_[point].reset(); }
  /// Where each point is now; nothing for one that was lost.
  [[nodiscard]] const std::vector<std::optional<Eigen::Vector2d>>& points() const { return points_; }

 private:
  struct Pictures;
  std::unique_ptr<Pictures> pictures_;
  std::vector<std::optional<Eigen::Vector2d>> points_;
};

}  // namespace kiroku::compare

// Recorded pictures as a camera without distortion has them, and what is drawn in such a camera as the lens
// shows it. An object belongs to one thread.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "sim/render/camera.h"
#include "sim/render/lens.h"
#include "sim/render/picture.h"

namespace kiroku::sim {

/// Recorded pictures as the lens's ideal camera has them (Lens::field_deg), of the same size.
class StraightPictures {
 public:
  explicit StraightPictures(const Lens& lens) : lens_(lens) {}
  /// Linear between pixels. kiroku::UsageError as Lens::require_shape().
  Picture straight(const Picture& recorded);

 private:
  void make_map(int width, int height);

  Lens lens_;
  int width_ = 0, height_ = 0;
  std::vector<float> map_;  // (height x width x 2), the recorded pixel of each
};

/// What is drawn in the ideal camera as the lens shows it, over recorded pictures of one size.
class BentPictures {
 public:
  /// For recorded pictures that are shown with that size.
  BentPictures(const Lens& lens, int width, int height);

  /// The picture in which to draw has that size, so that nothing loses detail, and shows all that the
  /// recorded picture does.
  [[nodiscard]] int drawn_width() const { return drawn_width_; }
  [[nodiscard]] int drawn_height() const { return drawn_height_; }
  /// The camera for it, from that of the same place with any field.
  [[nodiscard]] Camera drawn(Camera camera) const;
  /// Linear between what is drawn; a pixel of which less than half is drawn has the background, which is told
  /// by its colour.
  [[nodiscard]] Picture bent(const Picture& drawn, const Rgb& background) const;

 private:
  int width_, height_, drawn_width_ = 0, drawn_height_ = 0;
  Eigen::Vector2d half_extent_;
  std::vector<Eigen::Vector2f> map_;  // (height x width), where in the drawn picture each pixel is
};

}  // namespace kiroku::sim

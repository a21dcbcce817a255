// What synthetic scenes are drawn with: layers that are laid over pictures of yuv420p. Colours are RGB from 0
// to 255. Functions and objects that do not change are thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "media/libav_handles.h"

namespace kiroku::recorder {

/// `alpha` is from 0 (clear) to 255.
struct Paint {
  float red = 0, green = 0, blue = 0, alpha = 255;
};

/// BT.601 in limited range.
struct LumaChroma {
  float luma = 16, blue = 128, red = 128;
};
LumaChroma luma_chroma_of(const Paint& paint);

/// A picture of yuv420p with square pixels whose samples are nobody's yet. Throws std::bad_alloc.
media::Frame new_picture(int width, int height);

/// One number for each pixel, row by row.
class ScenePlane {
 public:
  ScenePlane(int width, int height);
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] std::span<float> row(int y);
  [[nodiscard]] std::span<const float> row(int y) const;
  /// Each becomes the mean over 2 `radius` + 1 columns and rows; what stands at an edge goes on beyond it.
  /// Two or three of them one after the other are nearly Gaussian.
  void blur(int radius);

 private:
  int width_, height_;
  std::vector<float> values_;
};

/// What stands at each pixel, before it is rounded. Chroma has half as many rows and columns.
struct Drawing {
  /// Of even size. `at(x, y)` gives each pixel's Paint.
  template <typename At>
  Drawing(int width, int height, const At& at)
      : luma(width, height), blue(width / 2, height / 2), red(width / 2, height / 2), alpha(width, height) {
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) put(x, y, at(x, y));
  }
  void put(int x, int y, const Paint& paint);

  ScenePlane luma, blue, red, alpha;
};

/// A drawing to be laid over pictures.
class SceneLayer {
 public:
  explicit SceneLayer(const Drawing& drawing);
  /// Its upper left corner comes to x, y, made even; what is beyond the picture's edges is left out.
  void lay_over(AVFrame& picture, int x, int y) const;
  /// The picture becomes a part of this layer, from x, y, made even, on. Nothing shines through.
  void fill(AVFrame& picture, int x, int y) const;

 private:
  struct Samples {
    int width = 0;
    std::vector<std::uint8_t> values;
  };
  /// Columns of a row that are not clear.
  struct Stretch {
    int first = 0, last = 0;
  };
  static Samples rounded(const ScenePlane& plane);

  std::array<Samples, 3> samples_;
  std::array<Samples, 2> alpha_;  // of luma, and of chroma
  std::vector<Stretch> stretches_;
};

}  // namespace kiroku::recorder

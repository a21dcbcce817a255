#include "media/quality/plane.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include "base/error.h"

namespace kiroku::media {
namespace {

std::size_t size_of(int count) { return static_cast<std::size_t>(count); }

/// The plane with `radius` more pixels on each side, its own mirrored; the outermost one is not repeated.
Plane mirrored(const Plane& plane, int radius) {
  const auto inside = [](int at, int count) {
    const int period = std::max(1, 2 * (count - 1));
    const int folded = std::abs(at) % period;
    return folded < count ? folded : period - folded;
  };
  Plane wide{plane.width + 2 * radius, plane.height + 2 * radius, {}};
  wide.samples.reserve(size_of(wide.width) * size_of(wide.height));
  for (int y = 0; y < wide.height; ++y) {
    const int from = inside(y - radius, plane.height);
    for (int x = 0; x < wide.width; ++x)
      wide.samples.push_back(plane.at(inside(x - radius, plane.width), from));
  }
  return wide;
}

}  // namespace

Plane luma_of(const AVFrame& picture) {
  const AVPixFmtDescriptor* const format = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(picture.format));
  if (format == nullptr || (format->flags & (AV_PIX_FMT_FLAG_RGB | AV_PIX_FMT_FLAG_BE)) != 0 ||
      format->comp[0].plane != 0 || format->comp[0].shift != 0 ||
      format->comp[0].step != (format->comp[0].depth > 8 ? 2 : 1)) {
    throw Error(std::string("pictures of the format ") + (format == nullptr ? "(unknown)" : format->name) +
                " have no luma of their own to measure");
  }
  Plane luma{picture.width, picture.height, {}};
  luma.samples.reserve(size_of(luma.width) * size_of(luma.height));
  const int depth = format->comp[0].depth;
  const float scale = 1.F / static_cast<float>(1 << (depth - 8));
  for (int y = 0; y < picture.height; ++y) {
    const std::uint8_t* const row = picture.data[0] + std::ptrdiff_t{y} * picture.linesize[0];
    for (int x = 0; x < picture.width; ++x) {
      std::uint16_t sample = row[x];
      if (depth > 8) std::memcpy(&sample, row + std::ptrdiff_t{2} * x, sizeof sample);
      luma.samples.push_back(static_cast<float>(sample) * scale);
    }
  }
  return luma;
}

std::vector<float> gaussian_taps(double sigma, int radius) {
  std::vector<double> taps;
  double sum = 0;
  for (int i = -radius; i <= radius; ++i) sum += taps.emplace_back(std::exp(-0.5 * i * i / (sigma * sigma)));
  std::vector<float> scaled;
  for (const double tap : taps) scaled.push_back(static_cast<float>(tap / sum));
  return scaled;
}

Plane filtered_within(const Plane& plane, const std::vector<float>& taps) {
  const int reach = static_cast<int>(taps.size()) - 1;
  if (plane.width <= reach || plane.height <= reach)
    throw Error("a picture of " + std::to_string(plane.width) + "x" + std::to_string(plane.height) +
                " is smaller than what smooths it");
  Plane across{plane.width - reach, plane.height, {}};
  across.samples.assign(size_of(across.width) * size_of(across.height), 0);
  for (int y = 0; y < plane.height; ++y) {
    const float* const from = plane.samples.data() + size_of(y) * size_of(plane.width);
    float* const to = across.samples.data() + size_of(y) * size_of(across.width);
    for (std::size_t t = 0; t < taps.size(); ++t) {
      for (int x = 0; x < across.width; ++x) to[x] += taps[t] * from[size_of(x) + t];
    }
  }
  Plane both{across.width, plane.height - reach, {}};
  both.samples.assign(size_of(both.width) * size_of(both.height), 0);
  for (int y = 0; y < both.height; ++y) {
    float* const to = both.samples.data() + size_of(y) * size_of(both.width);
    for (std::size_t t = 0; t < taps.size(); ++t) {
      const float* const from = across.samples.data() + (size_of(y) + t) * size_of(across.width);
      for (int x = 0; x < both.width; ++x) to[x] += taps[t] * from[x];
    }
  }
  return both;
}

Plane blurred(const Plane& plane, double sigma) {
  constexpr double kCutOff = 4;
  const int radius = std::max(1, static_cast<int>(std::ceil(kCutOff * sigma)));
  return filtered_within(mirrored(plane, radius), gaussian_taps(sigma, radius));
}

}  // namespace kiroku::media

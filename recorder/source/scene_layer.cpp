#include "recorder/source/scene_layer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <new>

extern "C" {
#include <libavutil/frame.h>
}

#include "base/error.h"

namespace kiroku::recorder {
namespace {

constexpr int kMost = 255;

int even(int number) { return number & ~1; }

/// `above` shines over `below` by `alpha`. Rows never overlap: without that word nothing of it is done for
/// many pixels at once.
void mix(std::uint8_t* __restrict below, const std::uint8_t* __restrict above,
         const std::uint8_t* __restrict alpha, int count) {
  for (int i = 0; i < count; ++i) {
    // Divided by 255, rounded.
    const auto sum = static_cast<std::uint16_t>(below[i] * (kMost - alpha[i]) + above[i] * alpha[i] + 128);
    below[i] = static_cast<std::uint8_t>((sum + (sum >> 8)) >> 8);
  }
}

}  // namespace

LumaChroma luma_chroma_of(const Paint& paint) {
  const float r = paint.red / kMost, g = paint.green / kMost, b = paint.blue / kMost;
  return {16 + 65.481F * r + 128.553F * g + 24.966F * b, 128 - 37.797F * r - 74.203F * g + 112.0F * b,
          128 + 112.0F * r - 93.786F * g - 18.214F * b};
}

media::Frame new_picture(int width, int height) {
  media::Frame picture = media::make_frame();
  picture->width = width;
  picture->height = height;
  picture->format = AV_PIX_FMT_YUV420P;
  picture->color_range = AVCOL_RANGE_MPEG;
  picture->sample_aspect_ratio = {1, 1};
  media::require(av_frame_get_buffer(picture.get(), 0), "cannot make a synthetic picture");
  return picture;
}

ScenePlane::ScenePlane(int width, int height)
    : width_(width),
      height_(height),
      values_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}

std::span<float> ScenePlane::row(int y) {
  const auto wide = static_cast<std::size_t>(width_);
  return std::span(values_).subspan(static_cast<std::size_t>(y) * wide, wide);
}
std::span<const float> ScenePlane::row(int y) const {
  const auto wide = static_cast<std::size_t>(width_);
  return std::span(values_).subspan(static_cast<std::size_t>(y) * wide, wide);
}

void ScenePlane::blur(int radius) {
  const float share = 1 / static_cast<float>(2 * radius + 1);
  const ScenePlane from = *this;
  const auto column = [&](int x) { return static_cast<std::size_t>(std::clamp(x, 0, width_ - 1)); };
  for (int y = 0; y < height_; ++y) {
    const std::span<const float> in = from.row(y);
    const std::span<float> out = row(y);
    float sum = 0;
    for (int x = -radius; x <= radius; ++x) sum += in[column(x)];
    for (int x = 0; x < width_; ++x) {
      out[static_cast<std::size_t>(x)] = sum * share;
      sum += in[column(x + radius + 1)] - in[column(x - radius)];
    }
  }
  const ScenePlane across = *this;
  const auto across_row = [&](int y) { return across.row(std::clamp(y, 0, height_ - 1)); };
  std::vector<float> sums(static_cast<std::size_t>(width_));
  for (int y = -radius; y <= radius; ++y)
    for (std::size_t x = 0; x < sums.size(); ++x) sums[x] += across_row(y)[x];
  for (int y = 0; y < height_; ++y) {
    const std::span<float> out = row(y);
    const std::span<const float> next = across_row(y + radius + 1), gone = across_row(y - radius);
    for (std::size_t x = 0; x < sums.size(); ++x) {
      out[x] = sums[x] * share;
      sums[x] += next[x] - gone[x];
    }
  }
}

void Drawing::put(int x, int y, const Paint& paint) {
  const LumaChroma colour = luma_chroma_of(paint);
  const auto at = static_cast<std::size_t>(x), half = static_cast<std::size_t>(x / 2);
  luma.row(y)[at] = colour.luma;
  alpha.row(y)[at] = paint.alpha;
  constexpr float kOfFour = 0.25F;
  blue.row(y / 2)[half] += kOfFour * colour.blue;
  red.row(y / 2)[half] += kOfFour * colour.red;
}

SceneLayer::Samples SceneLayer::rounded(const ScenePlane& plane) {
  Samples samples{plane.width(), {}};
  samples.values.reserve(static_cast<std::size_t>(plane.width()) * static_cast<std::size_t>(plane.height()));
  for (int y = 0; y < plane.height(); ++y)
    for (const float value : plane.row(y))
      samples.values.push_back(static_cast<std::uint8_t>(std::clamp(value, 0.0F, 255.0F) + 0.5F));
  return samples;
}

SceneLayer::SceneLayer(const Drawing& drawing)
    : samples_{rounded(drawing.luma), rounded(drawing.blue), rounded(drawing.red)} {
  ScenePlane chroma(drawing.blue.width(), drawing.blue.height());
  constexpr float kOfFour = 0.25F;
  for (int y = 0; y < drawing.alpha.height(); ++y)
    for (int x = 0; x < drawing.alpha.width(); ++x)
      chroma.row(y / 2)[static_cast<std::size_t>(x / 2)] +=
          kOfFour * drawing.alpha.row(y)[static_cast<std::size_t>(x)];
  alpha_ = {rounded(drawing.alpha), rounded(chroma)};
  // Of two rows together, which have their chroma in common.
  for (int y = 0; y < chroma.height(); ++y) {
    const std::span<const float> row = chroma.row(y);
    Stretch stretch;
    for (int x = 0; x < chroma.width(); ++x) {
      if (row[static_cast<std::size_t>(x)] <= 0) continue;
      if (stretch.last == 0) stretch.first = x;
      stretch.last = x + 1;
    }
    stretches_.push_back(stretch);
  }
}

void SceneLayer::lay_over(AVFrame& picture, int x, int y) const {
  const int left = even(x) / 2, top = even(y) / 2;
  const int rows = static_cast<int>(stretches_.size());
  for (int half = std::max(0, -top); half < std::min(rows, picture.height / 2 - top); ++half) {
    const Stretch& stretch = stretches_[static_cast<std::size_t>(half)];
    const int first = std::max(stretch.first, -left), last = std::min(stretch.last, picture.width / 2 - left);
    if (first >= last) continue;
    const auto lay = [&](int plane, int row, int scale) {
      const Samples& alpha = alpha_[plane == 0 ? 0 : 1];
      const std::ptrdiff_t from = std::ptrdiff_t{row} * alpha.width + scale * first;
      std::uint8_t* const below = picture.data[plane] +
                                  std::ptrdiff_t{row + scale * top} * picture.linesize[plane] +
                                  scale * (first + left);
      mix(below, samples_[static_cast<std::size_t>(plane)].values.data() + from, alpha.values.data() + from,
          scale * (last - first));
    };
    lay(0, 2 * half, 2);
    lay(0, 2 * half + 1, 2);
    lay(1, half, 1);
    lay(2, half, 1);
  }
}

void SceneLayer::fill(AVFrame& picture, int x, int y) const {
  for (int plane = 0; plane < 3; ++plane) {
    const int scale = plane == 0 ? 1 : 2;
    const Samples& samples = samples_[static_cast<std::size_t>(plane)];
    for (int row = 0; row < picture.height / scale; ++row)
      std::memcpy(
          picture.data[plane] + std::ptrdiff_t{row} * picture.linesize[plane],
          samples.values.data() + std::ptrdiff_t{row + even(y) / scale} * samples.width + even(x) / scale,
          static_cast<std::size_t>(picture.width / scale));
  }
}

}  // namespace kiroku::recorder

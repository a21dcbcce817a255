#include "media/quality/fine_texture.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "base/error.h"

namespace kiroku::media {
namespace {

constexpr int kDarkest = 40;          // of 255, the brightest channel
constexpr int kBrightest = 230;       // likewise
constexpr double kLeastColour = 0.2;  // saturation: 0 grey, 1 a pure colour
constexpr double kPaleColour = 0.35;
/// The sharp edge of a highlight, or of the frame round the picture, reaches so far into the bands.
constexpr int kAroundEdge = 8;

/// 1 in every square of 2 * `radius` + 1 pixels round a 1.
std::vector<std::uint8_t> grown(const std::vector<std::uint8_t>& mask, int width, int height, int radius) {
  const auto row = static_cast<std::size_t>(width);
  std::vector<std::uint8_t> across(mask.size(), 0), both(mask.size(), 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (mask[static_cast<std::size_t>(y) * row + static_cast<std::size_t>(x)] == 0) continue;
      const int from = std::max(0, x - radius), to = std::min(width - 1, x + radius);
      std::fill_n(across.begin() + std::ptrdiff_t{y} * width + from, to - from + 1, std::uint8_t{1});
    }
  }
  for (int y = 0; y < height; ++y) {
    const int from = std::max(0, y - radius), to = std::min(height - 1, y + radius);
    for (int near = from; near <= to; ++near) {
      for (std::size_t x = 0; x < row; ++x)
        both[static_cast<std::size_t>(near) * row + x] |= across[static_cast<std::size_t>(y) * row + x];
    }
  }
  return both;
}

}  // namespace

std::vector<std::uint8_t> tissue_mask(const PictureView& picture) {
  require_valid(picture);
  if (picture.channels != 3) throw Error("tissue is found by its colours: a grey picture has none");
  const std::size_t pixels = picture.samples.size() / 3;
  std::vector<std::uint8_t> tissue(pixels), beside(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const auto [least, most] = std::ranges::minmax(picture.samples.subspan(3 * i, 3));
    const double colour = most == 0 ? 0 : static_cast<double>(most - least) / most;
    beside[i] = most < kDarkest || (most >= kBrightest && colour < kPaleColour) ? 1 : 0;
    tissue[i] = colour >= kLeastColour ? 1 : 0;
  }
  const std::vector<std::uint8_t> near = grown(beside, picture.width, picture.height, kAroundEdge);
  for (std::size_t i = 0; i < pixels; ++i) tissue[i] = tissue[i] != 0 && near[i] == 0 ? 1 : 0;
  return tissue;
}

double share_of(const std::vector<std::uint8_t>& mask) {
  if (mask.empty()) return 0;
  return static_cast<double>(std::accumulate(mask.begin(), mask.end(), std::uint64_t{0})) /
         static_cast<double>(mask.size());
}

Plane band_of(const Plane& luma, double period) {
  constexpr double kShortestPeriod = 2;
  if (!(period >= kShortestPeriod)) throw Error("a pattern of less than two pixels is none");
  // The difference of Gaussians of deviations s and 2s passes most at the frequency sqrt(ln 4 / 6) / (pi s).
  const double sigma = period * std::sqrt(std::log(4.0) / 6) / std::numbers::pi;
  Plane band = blurred(luma, sigma);
  const Plane coarser = blurred(luma, 2 * sigma);
  std::ranges::transform(band.samples, coarser.samples, band.samples.begin(), std::minus<>());
  return band;
}

void TextureKept::add(const Plane& original, const Plane& coded, const std::vector<std::uint8_t>& mask) {
  if (original.samples.size() != coded.samples.size() || original.samples.size() != mask.size())
    throw Error("textures of pictures of different sizes cannot be compared");
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] == 0) continue;
    const double r = original.samples[i], d = coded.samples[i];
    original_ += r * r;
    coded_ += d * d;
    cross_ += r * d;
    ++pixels_;
  }
}

double TextureKept::kept() const { return original_ > 0 ? cross_ / original_ : 1; }

double TextureKept::foreign() const {
  return original_ > 0 ? std::max(0.0, coded_ - kept() * cross_) / original_ : 0;
}

double TextureKept::energy() const { return pixels_ == 0 ? 0 : original_ / static_cast<double>(pixels_); }

}  // namespace kiroku::media

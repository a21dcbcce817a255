#include "media/quality/structural_similarity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "base/error.h"

namespace kiroku::media {
namespace {

/// Of each scale, from the finest on.
constexpr std::array<double, 5> kWeights{0.0448, 0.2856, 0.3001, 0.2363, 0.1333};
constexpr double kWindowSigma = 1.5;
constexpr int kWindowRadius = 5;
constexpr double kLuminance = (0.01 * 255) * (0.01 * 255), kContrast = (0.03 * 255) * (0.03 * 255);

Plane product(const Plane& one, const Plane& other) {
  Plane made{one.width, one.height, {}};
  made.samples.resize(one.samples.size());
  std::ranges::transform(one.samples, other.samples, made.samples.begin(), std::multiplies<>());
  return made;
}

/// Each pixel the mean of four; the last of an uneven row or column counts twice.
Plane halved(const Plane& plane) {
  Plane made{(plane.width + 1) / 2, (plane.height + 1) / 2, {}};
  made.samples.reserve(static_cast<std::size_t>(made.width) * static_cast<std::size_t>(made.height));
  for (int y = 0; y < plane.height; y += 2) {
    const int below = std::min(y + 1, plane.height - 1);
    for (int x = 0; x < plane.width; x += 2) {
      const int right = std::min(x + 1, plane.width - 1);
      made.samples.push_back(
          (plane.at(x, y) + plane.at(right, y) + plane.at(x, below) + plane.at(right, below)) / 4);
    }
  }
  return made;
}

struct Similarity {
  double whole = 0;      // luminance, contrast and structure
  double structure = 0;  // contrast and structure alone
};

Similarity similarity(const Plane& one, const Plane& other) {
  static const std::vector<float> window = gaussian_taps(kWindowSigma, kWindowRadius);
  const Plane mean1 = filtered_within(one, window), mean2 = filtered_within(other, window);
  const Plane square1 = filtered_within(product(one, one), window);
  const Plane square2 = filtered_within(product(other, other), window);
  const Plane cross = filtered_within(product(one, other), window);
  Similarity sum;
  for (std::size_t i = 0; i < mean1.samples.size(); ++i) {
    const double m1 = mean1.samples[i], m2 = mean2.samples[i];
    const double variances = square1.samples[i] - m1 * m1 + square2.samples[i] - m2 * m2;
    const double structure = (2 * (cross.samples[i] - m1 * m2) + kContrast) / (variances + kContrast);
    sum.structure += structure;
    sum.whole += structure * (2 * m1 * m2 + kLuminance) / (m1 * m1 + m2 * m2 + kLuminance);
  }
  const auto count = static_cast<double>(mean1.samples.size());
  return {sum.whole / count, sum.structure / count};
}

}  // namespace

double ms_ssim(const Plane& one, const Plane& other) {
  if (one.width != other.width || one.height != other.height)
    throw Error("two pictures of different sizes have no structure in common");
  if (std::min(one.width, one.height) < kFewestMsSsimPixels)
    throw Error("a picture must have " + std::to_string(kFewestMsSsimPixels) +
                " pixels on each side to be compared at five scales");
  double result = 1;
  Plane a = one, b = other;
  for (std::size_t scale = 0; scale < kWeights.size(); ++scale) {
    if (scale > 0) a = halved(a), b = halved(b);
    const Similarity found = similarity(a, b);
    const double counted = scale + 1 == kWeights.size() ? found.whole : found.structure;
    // Structures that are each other's opposite have no root.
    result *= std::pow(std::max(counted, 0.0), kWeights[scale]);
  }
  return result;
}

}  // namespace kiroku::media

#include "media/quality/fine_texture.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::media {
namespace {

constexpr int kSide = 128;

/// A grating of stripes across, so many pixels from one to the next.
Plane grating(double period, double amplitude) {
  Plane plane{kSide, kSide, {}};
  for (int i = 0; i < kSide * kSide; ++i)
    plane.samples.push_back(
        static_cast<float>(128 + amplitude * std::sin(2 * std::numbers::pi * (i % kSide) / period)));
  return plane;
}

double energy(const Plane& band) {
  TextureKept sums;
  sums.add(band, band, std::vector<std::uint8_t>(band.samples.size(), 1));
  return sums.energy();
}

TextureKept compared(const Plane& original, const Plane& coded) {
  TextureKept sums;
  sums.add(band_of(original, 4), band_of(coded, 4), std::vector<std::uint8_t>(original.samples.size(), 1));
  return sums;
}

Plane sum_of(Plane one, const Plane& other) {
  for (std::size_t i = 0; i < one.samples.size(); ++i) one.samples[i] += other.samples[i] - 128;
  return one;
}

TEST(FineTexture, PassesItsPeriodMost) {
  const double at = energy(band_of(grating(4, 20), 4));
  EXPECT_GT(at, 0.15 * 20 * 20 / 2);
  for (const double other : {2.2, 8.0, 16.0, 64.0})
    EXPECT_LT(energy(band_of(grating(other, 20), 4)), 0.75 * at) << other;
  EXPECT_LT(energy(band_of(grating(64, 20), 4)), 0.001 * at);
  // By its transfer function, exp(-(2 pi f s)^2 / 2) for a deviation s, its ends left out by the average.
  const double s = 4 * std::sqrt(std::log(4.0) / 6) / std::numbers::pi, w = 2 * std::numbers::pi / 4;
  const double passed = std::exp(-w * w * s * s / 2) - std::exp(-4 * w * w * s * s / 2);
  EXPECT_NEAR(at, passed * passed * 20 * 20 / 2, 0.06 * at);
  EXPECT_THROW(band_of(grating(4, 1), 1), Error);
}

TEST(FineTexture, IsKeptByTheShareThatComesBack) {
  const Plane original = grating(4, 20);
  EXPECT_NEAR(compared(original, original).kept(), 1, 1e-9);
  EXPECT_NEAR(compared(original, original).foreign(), 0, 1e-9);
  EXPECT_NEAR(compared(original, grating(4, 5)).kept(), 0.25, 0.001);
  EXPECT_NEAR(compared(original, grating(4, 0)).kept(), 0, 1e-6);
  // Of two patterns of equal energy one is dropped, as a coder drops coefficients.
  const Plane down = [&] {
    Plane turned = original;
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x)
        turned.samples[static_cast<std::size_t>(y * kSide + x)] = original.at(y, x);
    }
    return turned;
  }();
  const TextureKept half = compared(sum_of(original, down), original);
  EXPECT_NEAR(half.kept(), 0.5, 0.01);
  EXPECT_NEAR(half.foreign(), 0.25, 0.01);
}

TEST(FineTexture, DoesNotTakeNoiseForTexture) {
  const Plane original = grating(4, 20);
  Plane noisy = original;
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0, 20);
  for (float& sample : noisy.samples) sample += noise(random);
  const TextureKept kept = compared(original, noisy);
  EXPECT_NEAR(kept.kept(), 1, 0.05);
  EXPECT_GT(kept.foreign(), 0.3);
  // Noise alone, where texture was: two power spectra would be the same.
  Plane instead = grating(4, 0);
  for (float& sample : instead.samples) sample += noise(random);
  EXPECT_NEAR(compared(original, instead).kept(), 0, 0.05);
}

TEST(FineTexture, IsMeasuredWhereTissueIsLit) {
  constexpr int kWidth = 96, kHeight = 4;
  std::vector<std::uint8_t> picture;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const int x = i % kWidth;
    if (x < 20) {  // tissue
      picture.insert(picture.end(), {200, 110, 90});
    } else if (x < 30) {  // in the dark
      picture.insert(picture.end(), {20, 8, 6});
    } else if (x < 60) {  // tissue
      picture.insert(picture.end(), {180, 90, 80});
    } else if (x < 70) {  // steel
      picture.insert(picture.end(), {150, 150, 155});
    } else if (x < 90) {  // tissue
      picture.insert(picture.end(), {90, 50, 40});
    } else {  // a highlight
      picture.insert(picture.end(), {252, 248, 246});
    }
  }
  const std::vector<std::uint8_t> mask = tissue_mask({kWidth, kHeight, 3, picture});
  for (const int x : {0, 11, 38, 59, 70, 81}) EXPECT_EQ(mask[static_cast<std::size_t>(x)], 1) << x;
  for (const int x : {12, 20, 29, 37, 60, 69, 82, 90, 95})
    EXPECT_EQ(mask[static_cast<std::size_t>(x)], 0) << x;
  EXPECT_NEAR(share_of(mask), (12 + 22 + 12) / 96.0, 1e-9);

  Plane one = grating(4, 20), other = one;
  std::vector<std::uint8_t> left(one.samples.size(), 0);
  for (std::size_t i = 0; i < left.size(); ++i) left[i] = i % kSide < kSide / 2 ? 1 : 0;
  for (std::size_t i = 0; i < left.size(); ++i) {
    if (left[i] == 0) other.samples[i] = 0;
  }
  TextureKept sums;
  sums.add(one, other, left);
  EXPECT_EQ(sums.kept(), 1);
}

}  // namespace
}  // namespace kiroku::media

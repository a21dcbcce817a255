#include "media/quality/structural_similarity.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::media {
namespace {

Plane pattern(int width, int height) {
  Plane plane{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      plane.samples.push_back(static_cast<float>(128 + 60 * std::sin(0.31 * x) * std::cos(0.17 * y) +
                                                 ((x / 16 + y / 16) % 2 == 0 ? 30 : -30)));
  }
  return plane;
}

Plane with_noise(Plane plane, double spread) {
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0, static_cast<float>(spread));
  for (float& sample : plane.samples) sample += noise(random);
  return plane;
}

/// The paper's formula as it stands: a window of 11x11 weights at each place, in double precision.
double by_definition(const Plane& first, const Plane& second) {
  constexpr double kWeights[5] = {0.0448, 0.2856, 0.3001, 0.2363, 0.1333};
  constexpr double kC1 = 6.5025, kC2 = 58.5225;
  double weight[11][11], sum = 0;
  for (int i = 0; i < 11; ++i) {
    for (int j = 0; j < 11; ++j)
      sum += weight[i][j] = std::exp(-((i - 5) * (i - 5) + (j - 5) * (j - 5)) / (2 * 1.5 * 1.5));
  }
  Plane a = first, b = second;
  double result = 1;
  for (int scale = 0; scale < 5; ++scale) {
    double whole = 0, structure = 0;
    int count = 0;
    for (int y = 0; y + 11 <= a.height; ++y) {
      for (int x = 0; x + 11 <= a.width; ++x) {
        double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
        for (int i = 0; i < 11; ++i) {
          for (int j = 0; j < 11; ++j) {
            const double w = weight[i][j] / sum, p = a.at(x + j, y + i), q = b.at(x + j, y + i);
            ma += w * p;
            mb += w * q;
            aa += w * p * p;
            bb += w * q * q;
            ab += w * p * q;
          }
        }
        const double cs = (2 * (ab - ma * mb) + kC2) / (aa - ma * ma + bb - mb * mb + kC2);
        structure += cs;
        whole += cs * (2 * ma * mb + kC1) / (ma * ma + mb * mb + kC1);
        ++count;
      }
    }
    result *= std::pow((scale == 4 ? whole : structure) / count, kWeights[scale]);
    for (Plane* plane : {&a, &b}) {
      Plane half{plane->width / 2, plane->height / 2, {}};
      for (int y = 0; y < half.height; ++y) {
        for (int x = 0; x < half.width; ++x)
          half.samples.push_back((plane->at(2 * x, 2 * y) + plane->at(2 * x + 1, 2 * y) +
                                  plane->at(2 * x, 2 * y + 1) + plane->at(2 * x + 1, 2 * y + 1)) /
                                 4);
      }
      *plane = half;
    }
  }
  return result;
}

TEST(StructuralSimilarity, IsWhatThePaperDefines) {
  const Plane original = pattern(192, 176);
  for (const double spread : {2.0, 12.0, 40.0}) {
    const Plane coded = with_noise(original, spread);
    EXPECT_NEAR(ms_ssim(original, coded), by_definition(original, coded), 2e-4) << spread;
  }
  const Plane smooth = blurred(original, 2);
  EXPECT_NEAR(ms_ssim(original, smooth), by_definition(original, smooth), 2e-4);
}

TEST(StructuralSimilarity, IsOneForTheSameAndFallsWithNoise) {
  const Plane original = pattern(181, 177);  // sides that halve unevenly
  EXPECT_NEAR(ms_ssim(original, original), 1, 1e-6);
  EXPECT_LT(ms_ssim(original, with_noise(original, 20)), ms_ssim(original, with_noise(original, 5)));
  EXPECT_LT(ms_ssim(original, with_noise(original, 5)), 1);
}

TEST(StructuralSimilarity, RefusesPicturesThatItsScalesDoNotFit) {
  EXPECT_THROW(ms_ssim(pattern(300, 175), pattern(300, 175)), Error);
  EXPECT_THROW(ms_ssim(pattern(192, 176), pattern(176, 192)), Error);
}

}  // namespace
}  // namespace kiroku::media

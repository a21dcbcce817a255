#include "media/quality/edges.h"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::media {
namespace {

Plane squares() {
  Plane plane{96, 80, {}};
  for (int y = 0; y < plane.height; ++y) {
    for (int x = 0; x < plane.width; ++x) plane.samples.push_back((x / 12 + y / 10) % 2 == 0 ? 200.F : 60.F);
  }
  return plane;
}

TEST(Edges, StayOrGo) {
  const Plane original = squares();
  EXPECT_NEAR(edges_kept(original, original), 1, 1e-12);
  Plane inverted = original, flat = original, brighter = original, noise = original;
  std::mt19937 random(5);
  std::normal_distribution<float> spread(0, 30);
  for (std::size_t i = 0; i < original.samples.size(); ++i) {
    inverted.samples[i] = 255 - original.samples[i];
    flat.samples[i] = 90;
    brighter.samples[i] = original.samples[i] * 0.5F + 40;
    noise.samples[i] = 128 + spread(random);
  }
  EXPECT_NEAR(edges_kept(original, inverted), -1, 1e-9);
  EXPECT_NEAR(edges_kept(original, brighter), 1, 1e-9);
  EXPECT_EQ(edges_kept(original, flat), 0);
  EXPECT_EQ(edges_kept(flat, flat), 1);
  EXPECT_NEAR(edges_kept(original, noise), 0, 0.05);
  const double soft = edges_kept(original, blurred(original, 1)),
               softer = edges_kept(original, blurred(original, 3));
  EXPECT_LT(soft, 0.9);
  EXPECT_LT(softer, soft);
  EXPECT_THROW(edges_kept(original, {2, 2, {0, 0, 0, 0}}), Error);
}

}  // namespace
}  // namespace kiroku::media

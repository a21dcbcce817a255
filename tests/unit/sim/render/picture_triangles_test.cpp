#include "sim/render/picture_triangles.h"

#include <random>

#include <gtest/gtest.h>

namespace kiroku::sim {
namespace {

Scene seen(int width, int height, bool parallel) {
  Scene scene;
  scene.width = width;
  scene.height = height;
  scene.camera.parallel = parallel;
  scene.camera.half_extent = parallel ? Eigen::Vector2d(0.016, 0.012) : Eigen::Vector2d(0.8, 0.6);
  return scene;
}

/// How often each pixel is hit.
std::vector<int> hits(const std::vector<PictureTriangle>& triangles, const PixelRays& rays) {
  std::vector<int> count(rays.u.size() * rays.v.size());
  for (const PictureTriangle& triangle : triangles) {
    for (int y = triangle.y0; y < triangle.y1; ++y) {
      for (int x = triangle.x0; x < triangle.x1; ++x) {
        if (triangle.hit(rays.u[static_cast<std::size_t>(x)], rays.v[static_cast<std::size_t>(y)]))
          ++count[static_cast<std::size_t>(y) * rays.u.size() + static_cast<std::size_t>(x)];
      }
    }
  }
  return count;
}

TEST(PictureTriangle, APixelIsInExactlyOneOfTheTrianglesAroundIt) {
  // A grid of triangles over the whole picture, its corners on pixels' middles, so that edges run through
  // them.
  for (const bool parallel : {false, true}) {
    const PixelRays rays = pixel_rays(seen(64, 48, parallel));
    std::mt19937 random(7);
    std::vector<Vector3> nodes;
    for (int row = 0; row <= 6; ++row) {
      for (int column = 0; column <= 8; ++column) {
        const double depth = parallel ? 30 : 20 + double(random() % 1000) / 50;
        const auto at = [](const std::vector<double>& slopes, int number) {
          // Between two pixels, the outermost beyond the border.
          const double pixel = 10 * number - 8.5;
          return slopes[0] + pixel * (slopes[1] - slopes[0]);
        };
        nodes.emplace_back(at(rays.u, column) * (parallel ? 1 : depth),
                           at(rays.v, row) * (parallel ? 1 : depth), -depth);
      }
    }
    std::vector<PictureTriangle> triangles;
    const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
      const std::array<Vector3, 3> corners{nodes[a], nodes[b], nodes[c]};
      const auto made = picture_triangle(corners, {a, b, c}, rays);
      ASSERT_TRUE(made.has_value());
      triangles.push_back(*made);
      const std::array<Vector3, 3> back{nodes[a], nodes[c], nodes[b]};
      EXPECT_FALSE(picture_triangle(back, {a, c, b}, rays)) << "its back";
    };
    for (std::uint32_t row = 0; row < 6; ++row) {
      for (std::uint32_t column = 0; column < 8; ++column) {
        const std::uint32_t a = row * 9 + column;
        add(a, a + 9, a + 10);
        add(a, a + 10, a + 1);
      }
    }
    for (const int count : hits(triangles, rays)) ASSERT_EQ(count, 1) << parallel;
  }
}

TEST(PictureTriangle, TellsTheDepthWhereARayMeetsIt) {
  const PixelRays rays = pixel_rays(seen(64, 48, false));
  const std::array<Vector3, 3> corners{Vector3(-10, -10, -20), Vector3(30, -8, -50), Vector3(0, 20, -30)};
  const auto triangle = picture_triangle(corners, {4, 2, 9}, rays);
  ASSERT_TRUE(triangle);
  const auto hit = triangle->hit(0.05, 0.02);
  ASSERT_TRUE(hit);
  const Vector3 place = hit->depth_mm * Vector3(0.05, 0.02, -1);
  const Vector3 sum = hit->shares[0] * corners[0] + hit->shares[1] * corners[1] + hit->shares[2] * corners[2];
  EXPECT_LT((place - sum).norm(), 1e-9);
}

TEST(PictureTriangle, MayReachBehindTheEye) {
  const PixelRays rays = pixel_rays(seen(64, 48, false));
  // A floor 5 mm below the eye, from far before it to far behind.
  const std::array<Vector3, 3> floor{Vector3(-500, -5, 300), Vector3(500, -5, 300), Vector3(0, -5, -4000)};
  const auto triangle = picture_triangle(floor, {0, 1, 2}, rays);
  ASSERT_TRUE(triangle);
  EXPECT_FALSE(triangle->hit(0, 0.1)) << "above the horizon";
  const auto below = triangle->hit(0.1, -0.25);
  ASSERT_TRUE(below);
  EXPECT_NEAR(below->depth_mm, 20, 1e-9);
}

TEST(TriangleTiles, NameEveryTriangleWhereItIsSeen) {
  const PixelRays rays = pixel_rays(seen(64, 48, false));
  const std::array<Vector3, 3> corners{Vector3(-4, -3, -20), Vector3(5, -3, -20), Vector3(0, 6, -20)};
  const std::vector<PictureTriangle> triangles{*picture_triangle(corners, {0, 1, 2}, rays)};
  const TriangleTiles tiles(triangles, 64, 48, 16);
  const std::vector<int> count = hits(triangles, rays);
  for (std::size_t y = 0; y < 48; ++y) {
    for (std::size_t x = 0; x < 64; ++x) {
      if (count[y * 64 + x] > 0) {
        EXPECT_EQ(tiles.of(y / 16 * 4 + x / 16).size(), 1U) << x << ',' << y;
      }
    }
  }
  EXPECT_TRUE(tiles.of(0).empty()) << "the left upper corner";
}

}  // namespace
}  // namespace kiroku::sim

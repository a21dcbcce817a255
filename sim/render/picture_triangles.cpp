#include "sim/render/picture_triangles.h"

#include <algorithm>
#include <cmath>

#include "sim/mesh/length_unit.h"

namespace kiroku::sim {
namespace {

/// What is nearer to the eye has no place in the picture that could be bounded.
constexpr double kLeastDepthMm = 1;

/// From corner a to corner b.
std::array<double, 3> edge_function(const Vector3& a, const Vector3& b, bool parallel) {
  if (parallel) return {a.y() - b.y(), b.x() - a.x(), a.x() * b.y() - a.y() * b.x()};
  const Vector3 across = a.cross(b);
  return {-across.x(), -across.y(), across.z()};
}

/// The pixels whose middles lie within [least, greatest], and one more each way.
std::array<int, 2> pixels_within(const std::vector<double>& rays, double least, double greatest) {
  const auto count = static_cast<int>(rays.size());
  const double first = rays.front(), step = count > 1 ? rays[1] - rays[0] : 1;
  double from = (least - first) / step, to = (greatest - first) / step;
  if (from > to) std::swap(from, to);
  const auto bounded = [&](double pixel) { return static_cast<int>(std::clamp(pixel, -1.0, count + 1.0)); };
  return {std::clamp(bounded(std::floor(from)) - 1, 0, count),
          std::clamp(bounded(std::ceil(to)) + 2, 0, count)};
}

}  // namespace

PixelRays pixel_rays(const Scene& scene) {
  PixelRays rays;
  const Camera& camera = scene.camera;
  rays.parallel = camera.parallel;
  rays.lens = scene.lens;
  const double scale = camera.parallel ? kMmPerM : 1;
  for (int x = 0; x < scene.width; ++x)
    rays.u.push_back(scale *
                     (camera.centre.x() + ((x + 0.5) / scene.width * 2 - 1) * camera.half_extent.x()));
  for (int y = 0; y < scene.height; ++y) {
    rays.v.push_back(scale *
                     (camera.centre.y() + (1 - (y + 0.5) / scene.height * 2) * camera.half_extent.y()));
  }
  return rays;
}

std::optional<PictureTriangle> picture_triangle(std::span<const Vector3, 3> corners_mm,
                                                const std::array<std::uint32_t, 3>& numbers,
                                                const PixelRays& rays) {
  PictureTriangle triangle;
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const std::size_t a = (corner + 1) % 3, b = (corner + 2) % 3;
    triangle.owns_edge[corner] = numbers[a] < numbers[b];
    // Always from the lesser number, so that both triangles of an edge round alike.
    triangle.edges[corner] = triangle.owns_edge[corner]
                                 ? edge_function(corners_mm[a], corners_mm[b], rays.parallel)
                                 : edge_function(corners_mm[b], corners_mm[a], rays.parallel);
    if (!triangle.owns_edge[corner]) {
      for (double& factor : triangle.edges[corner]) factor = -factor;
    }
    triangle.depth_mm[corner] = -corners_mm[corner].z();
  }
  const Vector3 normal = (corners_mm[1] - corners_mm[0]).cross(corners_mm[2] - corners_mm[0]);
  if (!((rays.parallel ? normal.z() : -normal.dot(corners_mm[0])) > 0)) return std::nullopt;
  Eigen::Vector2d least = Eigen::Vector2d::Constant(1e300), greatest = -least;
  bool bounded = true;
  for (const Vector3& corner : corners_mm) {
    if (!rays.parallel && -corner.z() < kLeastDepthMm) {
      bounded = false;
      break;
    }
    const Eigen::Vector2d slope = corner.head<2>() / (rays.parallel ? 1 : -corner.z());
    least = least.cwiseMin(slope);
    greatest = greatest.cwiseMax(slope);
  }
  triangle.x1 = static_cast<int>(rays.u.size());
  triangle.y1 = static_cast<int>(rays.v.size());
  if (bounded && rays.lens) {
    const LensRays::Pixels pixels = rays.lens->pixels_within(least, greatest);
    triangle.x0 = pixels.x0;
    triangle.x1 = pixels.x1;
    triangle.y0 = pixels.y0;
    triangle.y1 = pixels.y1;
  } else if (bounded) {
    const auto columns = pixels_within(rays.u, least.x(), greatest.x());
    const auto rows = pixels_within(rays.v, least.y(), greatest.y());
    triangle.x0 = columns[0];
    triangle.x1 = columns[1];
    triangle.y0 = rows[0];
    triangle.y1 = rows[1];
  }
  if (triangle.x0 >= triangle.x1 || triangle.y0 >= triangle.y1) return std::nullopt;
  return triangle;
}

TriangleTiles::TriangleTiles(std::span<const PictureTriangle> triangles, int width, int height, int tile) {
  const auto across = static_cast<std::size_t>((width + tile - 1) / tile);
  const auto down = static_cast<std::size_t>((height + tile - 1) / tile);
  begin_.resize(across * down + 1);
  const auto each = [&](const auto& visit) {
    for (std::uint32_t number = 0; number < triangles.size(); ++number) {
      const PictureTriangle& triangle = triangles[number];
      for (int y = triangle.y0 / tile; y <= (triangle.y1 - 1) / tile; ++y) {
        for (int x = triangle.x0 / tile; x <= (triangle.x1 - 1) / tile; ++x)
          visit(static_cast<std::size_t>(y) * across + static_cast<std::size_t>(x), number);
      }
    }
  };
  each([&](std::size_t square, std::uint32_t) { ++begin_[square + 1]; });
  for (std::size_t square = 0; square + 1 < begin_.size(); ++square) begin_[square + 1] += begin_[square];
  numbers_.resize(begin_.back());
  std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
  each([&](std::size_t square, std::uint32_t number) { numbers_[next[square]++] = number; });
}

}  // namespace kiroku::sim

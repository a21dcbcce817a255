#include "viewer/compare/deformed_drawing.h"

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <vector>

#include "sim/render/colour_map.h"
#include "sim/render/picture_triangles.h"

namespace kiroku::compare {
namespace {

constexpr sim::Rgb kUntold{150, 150, 150}, kUntoldStripe{90, 90, 90};

/// Of a pixel that shows a face whose displacement is not told at each corner.
sim::Rgb stripe_at(int x, int y) {
  constexpr int kWide = 4;
  return (x + y) / kWide % 2 == 0 ? kUntold : kUntoldStripe;
}

/// The nearest face at each pixel, in the colour that is asked for: of a face, shares of its corners, and a
/// pixel. What is beside or behind the eye is left out.
void draw_faces(sim::Picture& picture, const sim::DrawnSurface& surface, const ShownDeformation& shown,
                const std::function<sim::Rgb(const std::array<std::uint32_t, 3>& face,
                                             const std::array<double, 3>& shares, int x, int y)>& colour) {
  constexpr double kMmPerM = 1000;
  sim::Scene scene;
  scene.width = picture.width;
  scene.height = picture.height;
  scene.camera = shown.camera;
  const sim::PixelRays rays = sim::pixel_rays(scene);
  std::vector<sim::Vector3> at_mm;
  for (std::size_t node = 0; node < surface.nodes.size(); ++node)
    at_mm.push_back(kMmPerM * shown.camera.view_m(surface.nodes[node] + shown.displacement_m[node]));
  std::vector<double> nearest_mm(
      static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height),
      std::numeric_limits<double>::infinity());
  for (const auto& face : surface.faces) {
    constexpr double kNearestMm = 1;
    const std::array<sim::Vector3, 3> corners{at_mm[face[0]], at_mm[face[1]], at_mm[face[2]]};
    if (std::ranges::any_of(corners, [](const sim::Vector3& at) { return -at.z() < kNearestMm; })) continue;
    const auto triangle = sim::picture_triangle(corners, face, rays);
    if (!triangle) continue;
    for (int y = triangle->y0; y < triangle->y1; ++y) {
      for (int x = triangle->x0; x < triangle->x1; ++x) {
        const auto hit =
            triangle->hit(rays.u[static_cast<std::size_t>(x)], rays.v[static_cast<std::size_t>(y)]);
        double& nearest = nearest_mm[static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) +
                                     static_cast<std::size_t>(x)];
        if (!hit || hit->depth_mm >= nearest) continue;
        nearest = hit->depth_mm;
        std::ranges::copy(colour(face, {hit->shares[0], hit->shares[1], hit->shares[2]}, x, y),
                          picture.pixel(x, y));
      }
    }
  }
}

}  // namespace

void draw_deformed(sim::Picture& picture, const sim::DrawnSurface& surface, const ShownDeformation& shown,
                   double scale_mm) {
  constexpr double kMmPerM = 1000;
  std::vector<double> size_mm;
  for (const sim::Vector3& way_m : shown.displacement_m) size_mm.push_back(kMmPerM * way_m.norm());
  draw_faces(
      picture, surface, shown,
      [&](const std::array<std::uint32_t, 3>& face, const std::array<double, 3>& shares, int x, int y) {
        if (!shown.told[face[0]] || !shown.told[face[1]] || !shown.told[face[2]]) return stripe_at(x, y);
        double size = 0;
        for (std::size_t corner = 0; corner < 3; ++corner) size += shares[corner] * size_mm[face[corner]];
        return sim::viridis(size / scale_mm);
      });
}

void draw_departure(sim::Picture& picture, const sim::DrawnSurface& surface, const ShownDeformation& shown,
                    const std::vector<float>& beyond_m, double scale_mm) {
  constexpr double kMmPerM = 1000;
  draw_faces(picture, surface, shown,
             [&](const std::array<std::uint32_t, 3>& face, const std::array<double, 3>& shares, int, int) {
               double size_m = 0;
               for (std::size_t corner = 0; corner < 3; ++corner) {
                 if (!(beyond_m[face[corner]] > 0)) return kUntold;
                 size_m += shares[corner] * beyond_m[face[corner]];
               }
               return sim::viridis(kMmPerM * size_m / scale_mm);
             });
}

}  // namespace kiroku::compare

// What the organ covers, against each of its triangles asked for itself.
#include "sim/align/silhouette.h"

#include <gtest/gtest.h>

#include "tests/support/endoscope_scene.h"

namespace kiroku::sim {
namespace {

/// Depth at which the ray of a pixel meets the nearest triangle, by Moeller and Trumbore; 0 where none.
double depth_along(const OrganSurface& surface, const Camera& camera, const Vector3& ray) {
  double nearest = 0;
  for (const auto& face : surface.faces) {
    const Vector3 a = camera.view_m(surface.nodes[face[0]]), b = camera.view_m(surface.nodes[face[1]]) - a,
                  c = camera.view_m(surface.nodes[face[2]]) - a, across = ray.cross(c);
    const double whole = b.dot(across);
    if (std::abs(whole) < 1e-15) continue;
    const double u = -a.dot(across) / whole;
    const Vector3 q = (-a).cross(b);
    const double v = ray.dot(q) / whole, along = c.dot(q) / whole;
    if (u < 0 || v < 0 || u + v > 1 || along <= 0) continue;
    if (nearest == 0 || along < nearest) nearest = along;
  }
  return nearest;
}

TEST(Silhouette, CoversWhatTheSurfaceCoversAtItsDepth) {
  const OrganSurface surface = organ_surface(test::liver_like_mesh({16, 5, 12}));
  const test::EndoscopeScene scene(test::liver_like_mesh({2, 2, 2}));
  constexpr int kAcross = 640, kDown = 480, kShrink = 2;
  const Pinhole pinhole = pinhole_of(60, kAcross, kDown);
  for (const double azimuth_deg : {-40.0, 8.0, 60.0}) {
    const Camera camera = scene.camera(azimuth_deg, -18, 0.14, 12);
    const auto drawn = silhouette_of(surface, camera, pinhole, kAcross, kDown, kShrink);
    ASSERT_TRUE(drawn);
    int covered = 0, differ = 0;
    for (int y = 0; y < drawn->height; y += 5) {
      for (int x = 0; x < drawn->width; x += 5) {
        const Vector3 ray =
            pinhole.place_m({kShrink * x + 0.5 * (kShrink - 1), kShrink * y + 0.5 * (kShrink - 1)}, 1);
        const double depth = depth_along(surface, camera, ray);
        covered += depth > 0 ? 1 : 0;
        if ((depth > 0) != (drawn->at(x, y) > 0)) {
          ++differ;
          continue;
        }
        EXPECT_NEAR(drawn->at(x, y), depth, 1e-5) << x << ", " << y;
      }
    }
    EXPECT_GT(covered, 300);
    // On the outline itself, rounding decides.
    EXPECT_LE(differ, 1);
  }
}

TEST(Silhouette, IsNoneOfAnOrganBesideTheEye) {
  const OrganSurface surface = organ_surface(test::liver_like_mesh({4, 3, 4}));
  Camera camera;
  camera.eye_m = surface.middle_m;
  EXPECT_FALSE(silhouette_of(surface, camera, pinhole_of(60, 64, 48), 64, 48, 1));
}

}  // namespace
}  // namespace kiroku::sim

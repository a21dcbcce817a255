// Lungs that were stretched as a whole are found again, from wherever they lie.
#include "sim/respiration/stretch_fit.h"

#include <gtest/gtest.h>

#include "tests/unit/sim/respiration/two_lungs.h"

namespace kiroku::sim {
namespace {

struct Stretched {
  TetMesh mesh = test::two_lungs(test::kCoarse);
  LungSurface surface = surface_of(mesh);
  DistanceField field;
  SurfacePoints points;

  template <typename Motion>
  explicit Stretched(Motion motion)
      : field(signed_distance(test::mask_of_two_lungs(motion))), points(points_on(field)) {}
};

TEST(StretchFit, AnEvenStretchIsFoundFromFarAway) {
  Eigen::Affine3d motion = Eigen::Affine3d::Identity();
  motion.translate(Vector3(0.02, -0.03, 0.3));
  motion.rotate(Eigen::AngleAxisd(0.1, Vector3(1, 0.5, -0.3).normalized()));
  motion.scale(Vector3(1.05, 1.2, 1.45));
  const Stretched lungs([&](const Vector3& p) { return Vector3(motion * p); });
  const StretchFit fit = fit_stretch(lungs.mesh, lungs.surface, lungs.field, lungs.points);
  for (std::size_t node = 0; node < lungs.mesh.nodes.size(); ++node) {
    EXPECT_LT((fit.places_m[node] - motion * lungs.mesh.nodes[node]).norm(), 0.003);
    EXPECT_LT((fit.whole * lungs.mesh.nodes[node] - motion * lungs.mesh.nodes[node]).norm(), 0.003);
  }
  EXPECT_LT(both_ways_m(lungs.surface, lungs.field, lungs.points, fit.places_m), 0.002);
}

TEST(StretchFit, EachLungHasItsOwn) {
  // Only the right lung fills.
  const auto motion = [](const Vector3& p) {
    return p.x() < 0 ? Vector3(1.1 * p.x() + 0.005, 1.15 * p.y(), 1.35 * p.z() - 0.04) : p;
  };
  const Stretched lungs(motion);
  const StretchFit fit = fit_stretch(lungs.mesh, lungs.surface, lungs.field, lungs.points);
  double whole_m = 0;
  for (std::size_t node = 0; node < lungs.mesh.nodes.size(); ++node) {
    EXPECT_LT((fit.places_m[node] - motion(lungs.mesh.nodes[node])).norm(), 0.004);
    whole_m = std::max(whole_m, (fit.whole * lungs.mesh.nodes[node] - motion(lungs.mesh.nodes[node])).norm());
  }
  EXPECT_GT(whole_m, 0.01);
}

}  // namespace
}  // namespace kiroku::sim

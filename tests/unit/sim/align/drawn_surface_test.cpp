#include "sim/align/drawn_surface.h"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "tests/support/endoscope_scene.h"

namespace kiroku::sim {
namespace {

double signed_volume_m3(const std::vector<Vector3>& nodes,
                        const std::vector<std::array<std::uint32_t, 3>>& faces) {
  double volume = 0;
  for (const auto& face : faces) volume += nodes[face[0]].dot(nodes[face[1]].cross(nodes[face[2]])) / 6;
  return volume;
}

TEST(DrawnSurface, IsTheOrgansOwnWhereThatIsCoarseEnough) {
  const OrganSurface surface = organ_surface(test::liver_like_mesh({8, 3, 6}));
  const DrawnSurface drawn = drawn_surface(surface, surface.nodes.size());
  EXPECT_EQ(drawn.nodes, surface.nodes);
  EXPECT_EQ(drawn.faces, surface.faces);
  EXPECT_EQ(drawn.moved_m, 0);
}

TEST(DrawnSurface, OfManyNodesIsCoarserAndSaysByHowMuch) {
  const OrganSurface surface = organ_surface(test::liver_like_mesh({40, 12, 30}));
  constexpr std::size_t kMost = 1500;
  ASSERT_GT(surface.nodes.size(), 2 * kMost);
  const DrawnSurface drawn = drawn_surface(surface, kMost);
  EXPECT_LE(drawn.nodes.size(), kMost);
  EXPECT_GT(drawn.nodes.size(), kMost / 3) << "no coarser than it must be";
  EXPECT_GT(drawn.moved_m, 0);
  EXPECT_LT(drawn.moved_m, 6e-3) << "of an organ 16 cm wide";
  // Each node of the organ has one of the drawn ones as near as that.
  for (const Vector3& node : surface.nodes) {
    const bool is_near = std::ranges::any_of(
        drawn.nodes, [&](const Vector3& one) { return (one - node).norm() <= drawn.moved_m + 1e-12; });
    ASSERT_TRUE(is_near);
  }
  for (const auto& face : drawn.faces) {
    EXPECT_EQ((std::set<std::uint32_t>{face[0], face[1], face[2]}).size(), 3U);
    for (const std::uint32_t node : face) ASSERT_LT(node, drawn.nodes.size());
  }
  // Still closed, and still outside out.
  EXPECT_NEAR(signed_volume_m3(drawn.nodes, drawn.faces), signed_volume_m3(surface.nodes, surface.faces),
              0.05 * signed_volume_m3(surface.nodes, surface.faces));
}

TEST(DrawnSurface, OfFewNodesEndsHoweverFewAreAskedFor) {
  const OrganSurface surface = organ_surface(test::liver_like_mesh({12, 4, 9}));
  const DrawnSurface drawn = drawn_surface(surface, 0);
  EXPECT_LE(drawn.nodes.size(), 8U);
  EXPECT_GE(drawn.nodes.size(), 1U);
  EXPECT_LE(drawn.moved_m, 2 * surface.reach_m);
}

}  // namespace
}  // namespace kiroku::sim

// What holds for every cut, and the cuts a surgeon makes.
#include "sim/cutting/vertex_preserving_cut.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/mesh/mesh_check.h"
#include "sim/mesh/mesh_reader.h"
#include "tests/support/organ_mesh.h"
#include "tests/support/shared_data.h"

namespace kiroku::sim {
namespace {

using testing::IsEmpty;

double volume_m3(const TetMesh& mesh) {
  double sum_m3 = 0;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) sum_m3 += signed_volume_m3(mesh, t);
  return sum_m3;
}

double quality(const TetMesh& mesh, std::size_t tetrahedron) {
  double squares = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      squares += (mesh.nodes[mesh.tetrahedra[tetrahedron][i]] - mesh.nodes[mesh.tetrahedra[tetrahedron][j]])
                     .squaredNorm();
    }
  }
  return 6 * std::sqrt(2.0) * signed_volume_m3(mesh, tetrahedron) / std::pow(squares / 6, 1.5);
}

std::vector<MeshFault> faults(const TetMesh& mesh) {
  std::vector<MeshFault> found;
  for (const MeshFinding& finding : check_mesh(mesh)) {
    // A cut may take a part off or a node's last tetrahedron; CutShape says what becomes of them.
    if (finding.fault != MeshFault::kSeveralPieces && finding.fault != MeshFault::kLooseNode)
      found.push_back(finding.fault);
  }
  return found;
}

/// A block of 10 cm, its nodes 1.25 cm apart; node (i, j, k) is i + 9 (j + 9 k).
TetMesh block() { return test::tet_grid({8, 8, 8}, {0.1, 0.1, 0.1}); }

/// A blade held upright from z_from to z_to that goes along x at y; in cm.
std::vector<BladePose> along_x(double from, double to, double y, double z_from, double z_to, int steps = 4) {
  std::vector<BladePose> path;
  for (int step = 0; step <= steps; ++step) {
    const double x = from + (to - from) * step / steps;
    path.push_back({Vector3(x, y, z_from) / 100, Vector3(x, y, z_to) / 100});
  }
  return path;
}

struct Cut {
  std::size_t removed = 0, left_alone = 0;
  double volume_lost_m3 = 0;
  std::vector<Face> opened;
};

Cut cut_along(VertexPreservingCut& body, const std::vector<BladePose>& path) {
  Cut all;
  for (const SweepSurface& sweep : sweep_surfaces(path)) {
    const CutStep step = body.cut(sweep);
    all.removed += step.change.removed.size();
    all.left_alone += step.left_alone;
    all.volume_lost_m3 += step.volume_lost_m3;
    all.opened.insert(all.opened.end(), step.opened.begin(), step.opened.end());
  }
  return all;
}

class RandomCuts : public testing::TestWithParam<const char*> {
 protected:
  static TetMesh mesh() {
    if (std::string(GetParam()) == "block") return block();
    if (std::string(GetParam()) == "organ") return test::organ_mesh({16, 12, 8}, {0.2, 0.14, 0.1});
    TetMesh mesh = read_mesh(test::shared_data(GetParam()), LengthUnit::kMetre).mesh;
    const double longest_m = extent_of(mesh).longest_side_m();
    for (Vector3& node : mesh.nodes) node *= 0.2 / longest_m;
    return mesh;
  }
};

TEST_P(RandomCuts, KeepVolumeTopologyAndPositivity) {
  const std::string name = GetParam();
  if (name.find('/') != std::string::npos) KIROKU_NEEDS_SHARED_DATA(name);
  const TetMesh whole = mesh();
  ASSERT_THAT(faults(whole), IsEmpty());
  const double before_m3 = volume_m3(whole);
  std::vector<double> least_quality;
  for (std::size_t t = 0; t < whole.tetrahedra.size(); ++t)
    least_quality.push_back(std::min(quality(whole, t), VertexPreservingCut::kLeastQuality));
  std::mt19937 random(1);
  std::size_t cuts_that_meet = 0, removed = 0, left_alone = 0;
  double largest_error = 0, lost = 0;
  for (int path = 0; path < 200; ++path) {
    VertexPreservingCut body(whole);
    double lost_m3 = 0;
    std::size_t gone = 0, steps = 0;
    for (const SweepSurface& sweep : sweep_surfaces(test::random_blade_path(extent_of(whole), random))) {
      const TetMesh last = body.mesh();
      const CutStep step = body.cut(sweep);
      ++steps;
      lost_m3 += step.volume_lost_m3;
      gone += step.change.removed.size();
      left_alone += step.left_alone;
      // What the step says is what was done.
      ASSERT_EQ(body.mesh().tetrahedra, whole.tetrahedra);
      ASSERT_EQ(body.mesh().nodes.size(), whole.nodes.size());
      for (const std::uint32_t t : step.change.removed) ASSERT_FALSE(body.present(t));
      std::size_t moved = 0;
      for (std::uint32_t node = 0; node < whole.nodes.size(); ++node) {
        if (body.mesh().nodes[node] == last.nodes[node]) continue;
        ASSERT_LT(moved, step.change.moved.size());
        ASSERT_EQ(step.change.moved[moved], node);
        ASSERT_EQ(step.change.positions_m[moved], body.mesh().nodes[node]);
        ++moved;
      }
      ASSERT_EQ(moved, step.change.moved.size());
      for (const Face& face : step.opened) ASSERT_TRUE(body.present(face.tetrahedron));

      const TetMesh left = body.remaining();
      ASSERT_EQ(left.tetrahedra.size() + gone, whole.tetrahedra.size());
      largest_error = std::max(largest_error, std::abs(before_m3 - volume_m3(left) - lost_m3) / before_m3);
      // Every volume positive, each face of one or two tetrahedra, each edge of the surface of two faces,
      // one fan of tetrahedra around each node.
      ASSERT_THAT(faults(left), IsEmpty()) << "path " << path << ", step " << steps;
      for (std::uint32_t t = 0; t < whole.tetrahedra.size(); ++t) {
        if (!body.present(t)) continue;
        ASSERT_GE(quality(body.mesh(), t), least_quality[t] * (1 - 1e-9)) << t;
      }
    }
    cuts_that_meet += gone > 0 ? 1 : 0;
    removed += gone;
    lost += lost_m3 / before_m3 / 200;
    ASSERT_GE(lost_m3, -1e-12 * before_m3);
  }
  EXPECT_LE(largest_error, 1e-12);
  EXPECT_GE(cuts_that_meet, 150U);
  char text[200];
  std::snprintf(text, sizeof text, "%zu met, %zu tetrahedra, %.2f %% of the volume a path, %zu nodes alone",
                cuts_that_meet, removed, 100 * lost, left_alone);
  RecordProperty("cuts", text);
}

INSTANTIATE_TEST_SUITE_P(Meshes, RandomCuts,
                         testing::Values("block", "organ", "sim/meshes/sofa_env/liver_volumetric.vtk",
                                         "sim/meshes/sofa_env/tissue_volume.msh"),
                         [](const auto& test) {
                           const std::string name = test.param;
                           if (name.find("liver") != std::string::npos) return std::string("liver");
                           return name.find("tissue") == std::string::npos ? name : std::string("tissue");
                         });

TEST(VertexPreservingCut, PartsABlockAlongAPlaneWithoutLosingVolume) {
  VertexPreservingCut body(block());
  const Cut cut = cut_along(body, along_x(-1, 11, 5.3, -1, 11));
  EXPECT_EQ(body.parts().count, 2U);
  EXPECT_EQ(cut.left_alone, 0U);
  // Corners cannot leave the shape, and nodes of its edges only slide: the rest closes.
  EXPECT_LE(cut.volume_lost_m3, 0.01 * 0.001);
  EXPECT_GE(cut.volume_lost_m3, 0);
  // Both faces of the cut lie on the plane the blade swept.
  double on_plane_m2 = 0, all_m2 = 0;
  for (const Face& face : cut.opened) {
    if (!body.present(face.tetrahedron)) continue;
    const auto at = [&](std::size_t i) { return body.mesh().nodes[face.nodes[i]]; };
    const double area_m2 = (at(1) - at(0)).cross(at(2) - at(0)).norm() / 2;
    all_m2 += area_m2;
    bool on_plane = true;
    for (std::size_t i = 0; i < 3; ++i) on_plane = on_plane && std::abs(at(i).y() - 0.053) < 1e-4;
    if (on_plane) on_plane_m2 += area_m2;
  }
  EXPECT_GE(on_plane_m2, 0.9 * 2 * 0.01);
  EXPECT_GE(on_plane_m2, 0.9 * all_m2);
}

TEST(VertexPreservingCut, LeavesTheShapeOfTheBodyAsItWas) {
  VertexPreservingCut body(block());
  cut_along(body, along_x(-1, 11, 5.3, -1, 11));
  for (std::uint32_t node = 0; node < body.mesh().nodes.size(); ++node) {
    const Vector3 before = block().nodes[node], after = body.mesh().nodes[node];
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      if (before[axis] != 0 && before[axis] != 0.1) continue;
      EXPECT_NEAR(after[axis], before[axis], 1e-15) << node;
    }
  }
}

TEST(VertexPreservingCut, BeginsAndEndsInsideWithoutPartingTheBody) {
  VertexPreservingCut body(block());
  const Cut cut = cut_along(body, along_x(3, 7, 5.3, 3, 7));
  EXPECT_GT(cut.removed, 0U);
  EXPECT_EQ(body.parts().count, 1U);
  for (const Face& face : cut.opened) {
    for (const std::uint32_t node : face.nodes) {
      const Vector3& at = body.mesh().nodes[node];
      // Nothing is opened farther than an element (1.25 cm along its edges, sqrt(3) across) from the sweep.
      EXPECT_LE((at - Vector3(0.05, 0.053, 0.05)).cwiseAbs().maxCoeff(), 0.02 + 0.0217);
    }
  }
}

TEST(VertexPreservingCut, MeetsTheBorder) {
  VertexPreservingCut body(block());
  const Cut cut = cut_along(body, along_x(-1, 5, 5.3, 5, 11));
  EXPECT_GT(cut.removed, 0U);
  EXPECT_EQ(body.parts().count, 1U);
  EXPECT_THAT(faults(body.remaining()), IsEmpty());
}

TEST(VertexPreservingCut, CrossesAnEarlierCut) {
  VertexPreservingCut body(block());
  cut_along(body, along_x(-1, 11, 5.3, -1, 11));
  std::vector<BladePose> across = along_x(-1, 11, 4.7, -1, 11);
  for (BladePose& pose : across) {
    std::swap(pose.tip.x(), pose.tip.y());
    std::swap(pose.heel.x(), pose.heel.y());
  }
  cut_along(body, across);
  EXPECT_EQ(body.parts().count, 4U);
  EXPECT_THAT(faults(body.remaining()), IsEmpty());
  EXPECT_GE(volume_m3(body.remaining()), 0.97 * 0.001);
}

TEST(VertexPreservingCut, FindsNothingLeftOnTheSamePlace) {
  VertexPreservingCut body(block());
  const SweepSurface sweep({{0.02, 0.053, -0.01}, {0.02, 0.053, 0.07}},
                           {{0.08, 0.053, -0.01}, {0.08, 0.053, 0.07}});
  EXPECT_GT(body.cut(sweep).change.removed.size(), 0U);
  for (int again = 0; again < 3; ++again) {
    const CutStep step = body.cut(sweep);
    EXPECT_THAT(step.change.removed, IsEmpty());
    EXPECT_THAT(step.change.moved, IsEmpty());
    EXPECT_THAT(step.opened, IsEmpty());
    EXPECT_EQ(step.volume_lost_m3, 0);
  }
}

TEST(VertexPreservingCut, TouchesOneNodeExactly) {
  const TetMesh whole = block();
  const std::uint32_t middle = 4 + 9 * (4 + 9 * 4);
  const Vector3 at = whole.nodes[middle];
  // A small square around the node, turned so that no other node or edge of the grid lies in it.
  const Vector3 along = Vector3(1, 0.31, 0.17).normalized(),
                across = along.cross(Vector3(0.2, 1, 0.4)).normalized();
  const auto pose = [&](double a, double from, double to) {
    return BladePose{at + a * along + from * across, at + a * along + to * across};
  };
  VertexPreservingCut body(whole);
  const CutStep step = body.cut(SweepSurface(pose(-1e-3, -1e-3, 1e-3), pose(1e-3, -1e-3, 1e-3)));
  EXPECT_GT(step.change.removed.size(), 0U);
  for (const std::uint32_t t : step.change.removed)
    EXPECT_THAT(whole.tetrahedra[t], testing::Contains(middle));
  EXPECT_EQ(step.left_alone, 0U);
  EXPECT_THAT(faults(body.remaining()), IsEmpty());
  // The sweep's last edge through the node only grazes it.
  VertexPreservingCut grazed(whole);
  EXPECT_THAT(grazed.cut(SweepSurface(pose(-1e-3, -1e-3, 1e-3), pose(0, -1e-3, 1e-3))).change.removed,
              IsEmpty());
}

TEST(VertexPreservingCut, LeavesABodyAloneThatItMisses) {
  VertexPreservingCut body(block());
  const Cut cut = cut_along(body, along_x(-1, 11, 12, -1, 11));
  EXPECT_EQ(cut.removed, 0U);
  EXPECT_EQ(cut.volume_lost_m3, 0);
  EXPECT_EQ(body.mesh().nodes, block().nodes);
}

TEST(VertexPreservingCut, CutsThroughNodesOfAGridAsBetweenThem) {
  VertexPreservingCut body(block());
  const Cut cut = cut_along(body, along_x(-1, 11, 5, -1, 11));
  EXPECT_EQ(body.parts().count, 2U);
  EXPECT_LE(cut.volume_lost_m3, 0.02 * 0.001);
}

TEST(VertexPreservingCut, MovesNodesBetweenRegionsWithinTheirFace) {
  TetMesh mesh = block();
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    double x = 0;
    for (const std::uint32_t node : mesh.tetrahedra[t]) x += mesh.nodes[node].x() / 4;
    mesh.regions[t] = x < 0.05 ? 1 : 2;
  }
  VertexPreservingCut body(mesh);
  cut_along(body, along_x(-1, 11, 5.3, -1, 11));
  bool moved = false;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (std::abs(mesh.nodes[node].x() - 0.05) > 1e-12) continue;
    EXPECT_NEAR(body.mesh().nodes[node].x(), 0.05, 1e-15);
    moved = moved || body.mesh().nodes[node] != mesh.nodes[node];
  }
  EXPECT_TRUE(moved);
}

TEST(VertexPreservingCut, GivesTheSameBitsTwice) {
  const TetMesh whole = test::organ_mesh({12, 9, 7}, {0.2, 0.14, 0.1});
  VertexPreservingCut one(whole), other(whole);
  std::mt19937 random(3);
  for (int path = 0; path < 5; ++path) {
    const auto poses = test::random_blade_path(extent_of(whole), random);
    cut_along(one, poses);
    cut_along(other, poses);
  }
  EXPECT_EQ(one.mesh().nodes, other.mesh().nodes);
  EXPECT_EQ(one.remaining().tetrahedra, other.remaining().tetrahedra);
}

TEST(VertexPreservingCut, RefusesAMeshThatNothingCanBeComputedWith) {
  TetMesh mesh = block();
  std::swap(mesh.tetrahedra[3][0], mesh.tetrahedra[3][1]);
  EXPECT_THROW(VertexPreservingCut{mesh}, Error);
}

}  // namespace
}  // namespace kiroku::sim

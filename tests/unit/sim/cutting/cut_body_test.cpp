#include "sim/cutting/cut_body.h"

#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/fem/elimination_order.h"
#include "sim/mesh/degrees_of_freedom.h"
#include "sim/mesh/mesh_reader.h"
#include "tests/support/organ_mesh.h"
#include "tests/support/shared_data.h"

namespace kiroku::sim {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::MatchesRegex;

const Materials kTissue{{0, {5e3, 0.45, 1060}}};

/// Held where x is least.
Constraints held_at_left(const TetMesh& mesh, double share) {
  const Extent extent = extent_of(mesh);
  Constraints constraints(mesh.nodes.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (mesh.nodes[node].x() <= extent.least.x() + share * (extent.greatest.x() - extent.least.x()))
      constraints.prescribe(node, Vector3::Zero(), "test");
  }
  return constraints;
}

Eigen::VectorXd random_forces(std::size_t nodes, std::mt19937& random) {
  Eigen::VectorXd force_n(first_row(nodes));
  for (double& component : force_n) component = 1e-3 * (test::uniform(random) - 0.5);
  return force_n;
}

/// The body that is left, made anew: only tetrahedra that bear; what has come loose is held where it was.
StaticSolution solved_anew(const CutBody& body, const Materials& materials, const Constraints& constraints,
                           Eigen::VectorXd force_n) {
  TetMesh left;
  left.nodes = body.shape().mesh().nodes;
  for (std::uint32_t t = 0; t < body.shape().mesh().tetrahedra.size(); ++t) {
    if (!body.bears(t)) continue;
    left.tetrahedra.push_back(body.shape().mesh().tetrahedra[t]);
    left.regions.push_back(body.shape().mesh().regions[t]);
  }
  return ElasticBody(left, materials, constraints).solve(force_n);
}

class CutBodyOnMeshes : public testing::TestWithParam<const char*> {};

TEST_P(CutBodyOnMeshes, SolvesAsABodyMadeAnewFromTheCutMesh) {
  const std::string name = GetParam();
  TetMesh mesh;
  if (name.find('/') != std::string::npos) {
    KIROKU_NEEDS_SHARED_DATA(name);
    mesh = read_mesh(test::shared_data(name), LengthUnit::kMetre).mesh;
    const double longest_m = extent_of(mesh).longest_side_m();
    for (Vector3& node : mesh.nodes) node *= 0.2 / longest_m;
  } else {
    mesh = name == "block" ? test::tet_grid({8, 8, 8}, {0.1, 0.1, 0.1})
                           : test::organ_mesh({12, 9, 7}, {0.2, 0.14, 0.1});
  }
  Materials materials;
  for (const std::int32_t region : regions_of(mesh)) materials.emplace(region, Material{5e3, 0.45});
  const Constraints constraints = held_at_left(mesh, 0.3);
  std::mt19937 random(2);
  double largest = 0;
  std::size_t fallen = 0, met = 0;
  // Three paths a body: after more, little is left of most.
  constexpr int kPaths = 200, kPathsABody = 3;
  std::optional<CutBody> body;
  for (int path = 0; path < kPaths; ++path) {
    if (path % kPathsABody == 0) body.emplace(mesh, materials, constraints);
    std::size_t removed = 0;
    for (const SweepSurface& sweep : sweep_surfaces(test::random_blade_path(extent_of(mesh), random))) {
      const CutShape::Step step = body->cut(sweep);
      fallen += step.fallen.size();
      removed += step.cut.change.removed.size();
    }
    met += removed > 0 ? 1 : 0;
    const Eigen::VectorXd force_n = random_forces(mesh.nodes.size(), random);
    const StaticSolution found = body->solve(force_n),
                         anew = solved_anew(*body, materials, constraints, force_n);
    ASSERT_TRUE(found.displacement_m.allFinite());
    largest = std::max(largest, (found.displacement_m - anew.displacement_m).lpNorm<Eigen::Infinity>() /
                                    anew.displacement_m.lpNorm<Eigen::Infinity>());
    largest = std::max(largest, (found.reaction_force_n - anew.reaction_force_n).lpNorm<Eigen::Infinity>() /
                                    anew.reaction_force_n.lpNorm<Eigen::Infinity>());
  }
  EXPECT_GE(met, 107U);
  EXPECT_LE(largest, 1e-8);
  char text[100];
  std::snprintf(text, sizeof text, "%.1e; %zu parts fell off", largest, fallen);
  RecordProperty("relative_difference", text);
}

INSTANTIATE_TEST_SUITE_P(Meshes, CutBodyOnMeshes,
                         testing::Values("block", "organ", "sim/meshes/sofa_env/liver_volumetric.vtk",
                                         "sim/meshes/sofa_env/tissue_volume.msh"),
                         [](const auto& test) {
                           const std::string name = test.param;
                           if (name.find("liver") != std::string::npos) return std::string("liver");
                           return name.find("tissue") == std::string::npos ? name : std::string("tissue");
                         });

/// A block of 10 x 10 x 5 cm held at its floor, pulled apart at the left and right of its top.
class CutBlock : public testing::Test {
 protected:
  CutBlock() {
    for (std::size_t node = 0; node < mesh_.nodes.size(); ++node) {
      const Vector3& here = mesh_.nodes[node];
      if (here.z() == 0) constraints_.prescribe(node, Vector3::Zero(), "test");
      if (here.z() == 0.05 && here.x() == 0) force_n_[first_row(node)] = -0.02;
      if (here.z() == 0.05 && here.x() == 0.1) force_n_[first_row(node)] = 0.02;
    }
  }
  /// Down the middle from one side to the other, to 3 cm below the top.
  [[nodiscard]] static std::vector<BladePose> incision() {
    std::vector<BladePose> path;
    for (int step = 0; step <= 6; ++step) {
      const double y = -0.01 + 0.02 * step;
      path.push_back({{0.052, y, 0.02}, {0.052, y, 0.06}});
    }
    return path;
  }
  /// How far apart what is nearest left and right of the incision stands at the middle of the top.
  [[nodiscard]] static double gap_m(const CutBody& body, const Eigen::VectorXd& displacement_m) {
    double left = -1, right = 1, left_m = 0, right_m = 0;
    for (std::size_t node = 0; node < body.shape().mesh().nodes.size(); ++node) {
      const Vector3& here = body.shape().mesh().nodes[node];
      if (here.z() < 0.05 - 1e-9 || std::abs(here.y() - 0.05) > 0.007) continue;
      const double x = here.x() - 0.052, moved_m = here.x() + displacement_m[first_row(node)];
      if (x <= 0 && x > left) {
        left = x;
        left_m = moved_m;
      }
      if (x > 0 && x < right) {
        right = x;
        right_m = moved_m;
      }
    }
    return right_m - left_m - (right - left);
  }

  TetMesh mesh_ = test::tet_grid({16, 16, 8}, {0.1, 0.1, 0.05});
  Constraints constraints_{mesh_.nodes.size()};
  Eigen::VectorXd force_n_ = Eigen::VectorXd::Zero(first_row(mesh_.nodes.size()));
};

TEST_F(CutBlock, OpensWhenPulledAndAnUncutOneDoesNot) {
  CutBody body(mesh_, kTissue, constraints_);
  const double uncut_m = gap_m(body, body.solve(force_n_).displacement_m);
  for (const SweepSurface& sweep : sweep_surfaces(incision())) EXPECT_THAT(body.cut(sweep).fallen, IsEmpty());
  const double cut_m = gap_m(body, body.solve(force_n_).displacement_m);
  // Uncut, the middle stretches by what a strip of an element's width takes of it.
  EXPECT_LT(uncut_m, 0.3e-3);
  EXPECT_GT(cut_m, 3e-3);
  RecordProperty("gap",
                 std::to_string(cut_m * 1e3) + " mm cut, " + std::to_string(uncut_m * 1e3) + " mm uncut");
}

TEST_F(CutBlock, HoldsAPartThatFallsOffWhereItWas) {
  CutBody body(mesh_, kTissue, constraints_);
  // Level through the block: the upper part hangs on nothing.
  std::vector<std::string> fallen;
  for (const SweepSurface& sweep : sweep_surfaces(
           {{{-0.01, -0.01, 0.033}, {-0.01, 0.11, 0.033}}, {{0.11, -0.01, 0.033}, {0.11, 0.11, 0.033}}}))
    fallen = body.cut(sweep).fallen;
  EXPECT_THAT(fallen,
              ElementsAre(MatchesRegex("a part of [0-9]+ tetrahedra with node [0-9]+ hangs on nothing that "
                                       "is fixed any longer: it is held where it was")));
  // All that pulls pulls at what has fallen off.
  const StaticSolution solution = body.solve(force_n_);
  EXPECT_EQ(solution.displacement_m.norm(), 0);
  EXPECT_EQ(solution.reaction_force_n.norm(), 0);
  for (const SymmetricTensor& stress_pa : body.body().stress_pa(solution.displacement_m))
    ASSERT_EQ(stress_pa.norm(), 0);
  // Whatever is asked of what no longer bears: no strain, no stress.
  std::mt19937 random(8);
  const Eigen::VectorXd anything_m = random_forces(mesh_.nodes.size(), random);
  const std::vector<SymmetricTensor> stress_pa = body.body().stress_pa(anything_m);
  for (std::uint32_t t = 0; t < stress_pa.size(); ++t) EXPECT_EQ(stress_pa[t].norm() > 0, body.bears(t)) << t;
  // Cut again where it has fallen off, it stays so and is not told twice.
  for (const SweepSurface& sweep : sweep_surfaces(incision())) EXPECT_THAT(body.cut(sweep).fallen, IsEmpty());
  // Only what is held is weighed.
  double weight_n = 0;
  const Eigen::VectorXd weights_n = body.body().weight_n({0, 0, -9.81});
  for (Eigen::Index i = 2; i < weights_n.size(); i += 3) weight_n -= weights_n[i];
  EXPECT_NEAR(weight_n, 9.81 * 1060 * 0.1 * 0.1 * 0.033, 0.05 * weight_n);
}

TEST_F(CutBlock, GivesTheSameBitsTwice) {
  CutBody one(mesh_, kTissue, constraints_), other(mesh_, kTissue, constraints_);
  for (const SweepSurface& sweep : sweep_surfaces(incision())) {
    one.cut(sweep);
    other.cut(sweep);
  }
  EXPECT_EQ(one.solve(force_n_).displacement_m, other.solve(force_n_).displacement_m);
}

/// The matrix and the factor of a cut mesh, brought up to date step by step.
TEST_F(CutBlock, UpdatesMatrixAndFactorToTheBitsOfFreshOnesWhateverTheNumberOfThreads) {
  const std::vector<std::uint32_t> order = elimination_order(mesh_);
  const std::vector<const Material*> materials(mesh_.tetrahedra.size(), &kTissue.at(0));
  std::vector<bool> free(3 * mesh_.nodes.size());
  for (std::size_t number = 0; number < free.size(); ++number)
    free[number] = !constraints_.prescribed(number);
  for (const unsigned threads : {1U, 2U, 5U}) {
    StiffnessMatrix stepwise(mesh_, materials);
    Factorisation factor(stepwise, free, order, threads);
    VertexPreservingCut shape(mesh_);
    std::vector<bool> bears(mesh_.tetrahedra.size(), true);
    for (const SweepSurface& sweep : sweep_surfaces(incision())) {
      const CutStep step = shape.cut(sweep);
      std::vector<bool> touched(mesh_.nodes.size());
      for (std::uint32_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
        bears[t] = shape.present(t);
        const auto& corners = mesh_.tetrahedra[t];
        if (std::ranges::binary_search(step.change.removed, t) ||
            std::ranges::any_of(corners, [&](std::uint32_t node) {
              return std::ranges::binary_search(step.change.moved, node);
            })) {
          for (const std::uint32_t node : corners) touched[node] = true;
        }
      }
      std::vector<std::uint32_t> nodes;
      for (std::uint32_t node = 0; node < touched.size(); ++node) {
        if (touched[node]) nodes.push_back(node);
      }
      stepwise.update(shape.mesh(), materials, bears, nodes);
      factor.update(nodes);
    }
    StiffnessMatrix at_once(mesh_, materials);
    std::vector<std::uint32_t> all(mesh_.nodes.size());
    for (std::uint32_t node = 0; node < all.size(); ++node) all[node] = node;
    at_once.update(shape.mesh(), materials, bears, all);
    // As assembled from what is left; blocks that are only in the old pattern are zero.
    const TetMesh left = shape.remaining();
    const StiffnessMatrix assembled(left,
                                    std::vector<const Material*>(left.tetrahedra.size(), &kTissue.at(0)));
    for (std::size_t node = 0; node < all.size(); ++node) {
      for (std::size_t i = 0; i < stepwise.rows(node).size(); ++i) {
        ASSERT_EQ(stepwise.blocks(node)[i], at_once.blocks(node)[i]);
        const auto rows = assembled.rows(node);
        const auto found = std::ranges::lower_bound(rows, stepwise.rows(node)[i]);
        if (found == rows.end() || *found != stepwise.rows(node)[i]) {
          ASSERT_TRUE(stepwise.blocks(node)[i].isZero(0));
        } else {
          ASSERT_EQ(stepwise.blocks(node)[i],
                    assembled.blocks(node)[static_cast<std::size_t>(found - rows.begin())]);
        }
      }
    }
    const Factorisation fresh(at_once, free, order, 1);
    EXPECT_EQ(factor.solve(force_n_), fresh.solve(force_n_)) << threads;
  }
}

TEST_F(CutBlock, RefusesWhenNothingIsHeldAnyLonger) {
  Constraints constraints(mesh_.nodes.size());
  // Held by three corner nodes of the floor, on the left of the cut, right and left: the cut leaves neither.
  constraints.prescribe(0, Vector3::Zero(), "test");
  constraints.prescribe(16, Vector3::Zero(), "test");
  constraints.prescribe(16 * 17, Vector3::Zero(), "test");
  CutBody body(mesh_, kTissue, constraints);
  const SweepSurface across({{0.052, -0.01, -0.01}, {0.052, -0.01, 0.06}},
                            {{0.052, 0.11, -0.01}, {0.052, 0.11, 0.06}});
  try {
    body.cut(across);
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(),
                 "the cut leaves nothing that is held: fix a part of the body it does not part");
  }
}

}  // namespace
}  // namespace kiroku::sim

#include "sim/meshing/organ_mesher.h"

#include <numbers>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/fem/elastic_body.h"
#include "sim/mesh/mesh_check.h"
#include "sim/mesh/mesh_topology.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

/// 40 voxels of 2 mm along each axis, the middle in the middle; `label_at` of the place in mm from there.
LabelMap map_of(const std::function<int(const Vector3&)>& label_at,
                const Eigen::Matrix3d& direction = Eigen::Matrix3d::Identity()) {
  LabelMap map;
  map.grid.size = {40, 40, 40};
  map.grid.spacing_m = Vector3::Constant(0.002);
  map.grid.direction = direction;
  map.grid.origin_m = Vector3(0.1, -0.2, 0.3) - direction * Vector3::Constant(0.039);
  for (std::size_t offset = 0; offset < map.grid.voxels(); ++offset) {
    const Vector3 index(double(offset % 40), double(offset / 40 % 40), double(offset / 1600));
    map.labels.push_back(static_cast<std::uint16_t>(label_at(2 * index - Vector3::Constant(39))));
  }
  return map;
}
const Vector3 kMiddleM(0.1, -0.2, 0.3);

int sphere(const Vector3& at_mm) { return at_mm.norm() < 30 ? 3 : 0; }
double sphere_m3(double radius_m) { return 4 * std::numbers::pi / 3 * radius_m * radius_m * radius_m; }

std::vector<std::string> faults_of_organ(const TetMesh& mesh) {
  std::vector<std::string> texts;
  for (const MeshFinding& finding : check_mesh(mesh)) texts.push_back(finding.text);
  return texts;
}

void expect_sound(const OrganMesh& result, std::size_t wanted) {
  EXPECT_NEAR(double(result.mesh.nodes.size()), double(wanted), kNodeTolerance * double(wanted));
  EXPECT_GE(result.quality.least_dihedral_deg, kLeastDihedralDeg);
  EXPECT_THAT(faults_of_organ(result.mesh), IsEmpty());
}

TEST(OrganMesher, MeshesASphere) {
  const LabelMap map = map_of(sphere);
  for (const std::size_t wanted : {200U, 1500U}) {
    const OrganMesh result = make_organ_mesh(map, {wanted, 1});
    expect_sound(result, wanted);
    EXPECT_THAT(result.findings, IsEmpty());
    EXPECT_NEAR(result.quality.volume_m3 / sphere_m3(0.03), 1, wanted < 1000 ? 0.06 : 0.03);
    for (const Vector3& node : result.mesh.nodes) EXPECT_LT((node - kMiddleM).norm(), 0.0315);
    EXPECT_EQ(regions_of(result.mesh), std::vector<std::int32_t>{3});
    RecordProperty("volume_" + std::to_string(wanted),
                   std::to_string(result.quality.volume_m3 / sphere_m3(0.03)));
  }
}

TEST(OrganMesher, FollowsTheOrientationOfTheVolume) {
  // A box of three different sides, mirrored and turned, lies in the patient where its voxels do.
  const auto box = [](const Vector3& at_mm) {
    return (at_mm.array().abs() < Eigen::Array3d(34, 20, 10)).all() && at_mm.x() > -20 ? 1 : 0;
  };
  Eigen::Matrix3d mirrored = Eigen::AngleAxisd(0.4, Vector3(1, 2, 3).normalized()).toRotationMatrix();
  mirrored.col(2) *= -1;
  for (const Eigen::Matrix3d& direction : {Eigen::Matrix3d(Eigen::Matrix3d::Identity()), mirrored}) {
    const OrganMesh result = make_organ_mesh(map_of(box, direction), {600, 1});
    expect_sound(result, 600);
    TetMesh turned_back = result.mesh;
    for (Vector3& node : turned_back.nodes) node = direction.transpose() * (node - kMiddleM);
    const Extent extent = extent_of(turned_back);
    EXPECT_LT((extent.least - Vector3(-0.02, -0.02, -0.01)).cwiseAbs().maxCoeff(), 0.0015);
    EXPECT_LT((extent.greatest - Vector3(0.034, 0.02, 0.01)).cwiseAbs().maxCoeff(), 0.0015);
  }
}

TEST(OrganMesher, LetsMaterialsMeetWithoutGaps) {
  // A tumour in the middle, and a shell round half of the organ.
  const auto organ = [](const Vector3& at_mm) {
    if (at_mm.norm() < 12) return 7;
    if (at_mm.norm() < 30) return 1;
    return at_mm.norm() < 36 && at_mm.z() > 0 ? 2 : 0;
  };
  const OrganMesh result = make_organ_mesh(map_of(organ), {1500, 1});
  expect_sound(result, 1500);
  EXPECT_EQ(regions_of(result.mesh), (std::vector<std::int32_t>{1, 2, 7}));
  EXPECT_NEAR(result.quality.regions.at(7).volume_m3 / sphere_m3(0.012), 1, 0.15);
  EXPECT_NEAR(result.quality.regions.at(1).volume_m3 / (sphere_m3(0.03) - sphere_m3(0.012)), 1, 0.06);
  EXPECT_NEAR(result.quality.regions.at(2).volume_m3 / ((sphere_m3(0.036) - sphere_m3(0.03)) / 2), 1, 0.1);
  std::size_t shared_faces = 0;
  for (const auto& [one, other] : faces_of(result.mesh).between) {
    shared_faces += result.mesh.regions[one] != result.mesh.regions[other] ? 1U : 0U;
  }
  EXPECT_GT(shared_faces, 100U);
}

TEST(OrganMesher, ResolvesARegionSmallerThanTheCells) {
  const auto organ = [](const Vector3& at_mm) {
    return (at_mm - Vector3(12, 0, 0)).norm() < 5 ? 2 : at_mm.norm() < 35 ? 1 : 0;
  };
  const OrganMesh result = make_organ_mesh(map_of(organ), {200, 1});
  EXPECT_GE(result.quality.regions.at(2).tetrahedra, 4U);
  EXPECT_NEAR(result.quality.regions.at(2).volume_m3 / sphere_m3(0.005), 1, 0.5);
}

TEST(OrganMesher, KeepsTheLargestPiecesOfTheBody) {
  const auto organ = [](const Vector3& at_mm) {
    if ((at_mm - Vector3(-14, 0, 0)).norm() < 18) return 1;
    return (at_mm - Vector3(22, 0, 0)).norm() < 12 ? 1 : 0;
  };
  const OrganMesh one = make_organ_mesh(map_of(organ), {400, 1});
  expect_sound(one, 400);
  EXPECT_EQ(one.voxels.parts, 1U);
  EXPECT_NEAR(double(one.voxels.voxels) * 8e-9 / sphere_m3(0.012), 1, 0.05);
  EXPECT_THAT(one.findings, testing::Contains(HasSubstr("1 part of the body")));
  const OrganMesh two = make_organ_mesh(map_of(organ), {400, 2});
  EXPECT_EQ(node_connected_parts(two.mesh).count, 2U);
  EXPECT_EQ(two.voxels.parts, 0U);
  EXPECT_NEAR(two.quality.volume_m3, sphere_m3(0.018) + sphere_m3(0.012), 0.06 * two.quality.volume_m3);
}

TEST(OrganMesher, ClosesABodyAtTheBorderOfTheVolume) {
  const OrganMesh result =
      make_organ_mesh(map_of([](const Vector3& at_mm) { return at_mm.z() > 20 ? 1 : 0; }), {500, 1});
  expect_sound(result, 500);
  EXPECT_NEAR(result.quality.volume_m3, 0.08 * 0.08 * 0.02, 0.05 * 0.08 * 0.08 * 0.02);
}

TEST(OrganMesher, GivesTheSameMeshTwice) {
  const LabelMap map = map_of(sphere);
  const OrganMesh one = make_organ_mesh(map, {800, 1}), other = make_organ_mesh(map, {800, 1});
  EXPECT_EQ(one.mesh.nodes, other.mesh.nodes);
  EXPECT_EQ(one.mesh.tetrahedra, other.mesh.tetrahedra);
}

TEST(OrganMesher, MakesWhatTheSolverTakes) {
  const OrganMesh result = make_organ_mesh(map_of(sphere), {500, 1});
  Constraints held(result.mesh.nodes.size());
  for (std::uint32_t node = 0; node < result.mesh.nodes.size(); ++node) {
    if (result.mesh.nodes[node].z() < kMiddleM.z() - 0.02) held.prescribe(node, Vector3::Zero(), "held");
  }
  const ElasticBody body(result.mesh, {{3, Material{5000, 0.45}}}, held);
  const StaticSolution solution = body.solve(body.weight_n({0, 0, -9.81}));
  double lowest_m = 0, weight_n = 0;
  for (Eigen::Index at = 2; at < solution.displacement_m.size(); at += 3) {
    lowest_m = std::min(lowest_m, solution.displacement_m[at]);
    weight_n += solution.reaction_force_n[at];
  }
  EXPECT_LT(lowest_m, -1e-4);
  EXPECT_GT(lowest_m, -0.02);
  EXPECT_NEAR(weight_n, 9.81 * 1000 * result.quality.volume_m3, 1e-9);
}

TEST(OrganMesher, RefusesInOneSentence) {
  const auto refusal = [](const LabelMap& map, const MeshRequest& request) -> std::string {
    try {
      (void)make_organ_mesh(map, request);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal(map_of([](const Vector3&) { return 0; }), {500, 1}),
              HasSubstr("no voxel belongs to the body"));
  EXPECT_THAT(refusal(map_of(sphere), {19, 1}), HasSubstr("ask for 20 to"));
  EXPECT_THAT(refusal(map_of(sphere), {500, 0}), HasSubstr("0 pieces"));
  int label = 0;
  EXPECT_THAT(refusal(map_of([&](const Vector3&) { return ++label % 300; }), {500, 1}),
              HasSubstr("at most 255"));
}

}  // namespace
}  // namespace kiroku::sim

// Meshes of real patients.
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sim/fem/elastic_body.h"
#include "sim/mesh/mesh_check.h"
#include "sim/mesh/mesh_topology.h"
#include "sim/meshing/body_regions.h"
#include "sim/meshing/organ_mesher.h"
#include "tests/support/unpacked.h"

namespace kiroku::sim {
namespace {

using test::shared_data;

double labelled_m3(const LabelMap& map) {
  return double(map.labels.size() - std::size_t(std::ranges::count(map.labels, 0))) *
         map.grid.spacing_m.prod();
}

void expect_sound(const OrganMesh& result, std::size_t wanted, const BodyRegions& body, double tolerance) {
  EXPECT_NEAR(double(result.mesh.nodes.size()), double(wanted), kNodeTolerance * double(wanted));
  EXPECT_GE(result.quality.least_dihedral_deg, kLeastDihedralDeg);
  EXPECT_NEAR(result.quality.volume_m3 / labelled_m3(body.map), 1, tolerance);
  for (const MeshFinding& finding : check_mesh(result.mesh)) {
    EXPECT_EQ(finding.fault, MeshFault::kSeveralPieces) << finding.text;
  }
  const std::string of = "_" + std::to_string(wanted);
  testing::Test::RecordProperty("nodes" + of, std::to_string(result.mesh.nodes.size()));
  testing::Test::RecordProperty("least_dihedral_deg" + of, std::to_string(result.quality.least_dihedral_deg));
  testing::Test::RecordProperty("volume_ratio" + of,
                                std::to_string(result.quality.volume_m3 / labelled_m3(body.map)));
}

void expect_sound_lungs(std::initializer_list<std::size_t> vertices) {
  const test::Unpacked folder("sim/lung-ct/lidc-idri-0001-dicom.tar.xz");
  const VolumeFile file = read_volume(folder.path(), {});
  BodyRegions body = regions_of_labels(
      resampled(read_label_map(shared_data("sim/lung-ct/mask_totalsegmentator.nii.gz")), file.volume.grid),
      {{"lung", {organ_named("lung").labels}}});
  add_contours(body, read_contours(shared_data("sim/lung-ct/069.xml")), file);
  const double tumour_m3 = double(std::ranges::count(body.map.labels, 2)) * body.map.grid.spacing_m.prod();
  for (const std::size_t wanted : vertices) {
    const OrganMesh result = make_organ_mesh(body.map, {wanted, 2});
    expect_sound(result, wanted, body, wanted < 1000 ? 0.08 : 0.03);
    // Where the segmentation lets both lungs touch, they are one.
    EXPECT_LE(node_connected_parts(result.mesh).count, 2U);
    EXPECT_NEAR(result.quality.regions.at(2).volume_m3 / tumour_m3, 1, 0.35) << wanted;
  }
}

TEST(RealMesh, LungWithItsTumour) {
  KIROKU_NEEDS_SHARED_DATA("sim/lung-ct");
  expect_sound_lungs({600});
}

TEST(RealMeshNightly, FinerLungsWithTheirTumour) {
  KIROKU_NEEDS_SHARED_DATA("sim/lung-ct");
  expect_sound_lungs({5000, 20000});
}

TEST(RealMesh, LiverBecomesABodyThatHangs) {
  KIROKU_NEEDS_SHARED_DATA("sim/abdomen");
  const BodyRegions body = regions_of_labels(read_label_map(shared_data("sim/abdomen/example_seg.nii.gz")),
                                             {{"liver", {organ_named("liver").labels}}});
  const OrganMesh result = make_organ_mesh(body.map, {1500, 1});
  expect_sound(result, 1500, body, 0.06);
  const Extent extent = extent_of(result.mesh);
  Constraints held(result.mesh.nodes.size());
  for (std::uint32_t node = 0; node < result.mesh.nodes.size(); ++node) {
    if (result.mesh.nodes[node].z() > extent.greatest.z() - 0.015)
      held.prescribe(node, Vector3::Zero(), "held");
  }
  const ElasticBody elastic(result.mesh, {{1, Material{5000, 0.45}}}, held);
  const Eigen::VectorXd displacement_m = elastic.solve(elastic.weight_n({0, 0, -9.81})).displacement_m;
  EXPECT_TRUE(displacement_m.allFinite());
  EXPECT_GT(displacement_m.cwiseAbs().maxCoeff(), 1e-4);
  EXPECT_LT(displacement_m.cwiseAbs().maxCoeff(), 0.05);
}

}  // namespace
}  // namespace kiroku::sim

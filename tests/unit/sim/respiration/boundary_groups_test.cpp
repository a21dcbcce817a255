// Each rule that sorts the surface of a lung, on boxes whose faces are known.
#include "sim/respiration/boundary_groups.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

const Vector3 kSizeM(0.1, 0.15, 0.25);

/// Cells of 25 mm; its lowest corner where it is wanted.
TetMesh box_lung(const Vector3& corner_m) {
  TetMesh mesh = test::tet_grid({4, 6, 10}, kSizeM);
  for (Vector3& node : mesh.nodes) node += corner_m;
  return mesh;
}

/// A right lung: the midline is where x is greater.
const Vector3 kRightM(-0.12, 0, 0);

std::uint32_t nearest(const TetMesh& mesh, const Vector3& place_m) {
  std::uint32_t found = 0;
  for (std::uint32_t node = 0; node < mesh.nodes.size(); ++node) {
    if ((mesh.nodes[node] - place_m).norm() < (mesh.nodes[found] - place_m).norm()) found = node;
  }
  return found;
}

/// `at`: in parts of the box.
BoundaryGroup group_at(const TetMesh& mesh, const BoundaryGroups& groups, const Vector3& corner_m,
                       const Vector3& at) {
  return groups[nearest(mesh, corner_m + at.cwiseProduct(kSizeM))];
}

GroupRules right() {
  GroupRules rules;
  rules.side = LungSide::kRight;
  return rules;
}

TEST(BoundaryGroups, ASurfaceHasOutwardNormalsAndItsArea) {
  const TetMesh mesh = box_lung(kRightM);
  const LungSurface surface = surface_of(mesh);
  double area_m2 = 0;
  for (const double part_m2 : surface.areas_m2) area_m2 += part_m2;
  EXPECT_NEAR(area_m2, 2 * (0.1 * 0.15 + 0.1 * 0.25 + 0.15 * 0.25), 1e-12);
  const auto row = static_cast<std::size_t>(surface.row_of[nearest(mesh, kRightM + Vector3(0.05, 0.075, 0))]);
  EXPECT_LT((surface.normals[row] + Vector3::UnitZ()).norm(), 1e-12);
  EXPECT_EQ(surface.row_of[nearest(mesh, kRightM + kSizeM / 2)], -1);
}

TEST(BoundaryGroups, WhatFacesTheFeetIsDiaphragm) {
  const TetMesh mesh = box_lung(kRightM);
  const BoundaryGroups groups = find_boundary_groups(mesh, surface_of(mesh), nullptr, right());
  EXPECT_EQ(group_at(mesh, groups, kRightM, {0.5, 0.5, 0}), BoundaryGroup::kDiaphragm);
}

TEST(BoundaryGroups, WithLungBelowItIsNoDiaphragm) {
  // A slab hangs below the box, so that only one underside is free.
  TetMesh mesh = box_lung(kRightM);
  TetMesh slab = test::tet_grid({4, 6, 1}, {0.1, 0.15, 0.025});
  const auto first = static_cast<std::uint32_t>(mesh.nodes.size());
  for (const Vector3& node : slab.nodes) mesh.nodes.push_back(node + kRightM - Vector3(0, 0, 0.1));
  for (Tetrahedron corners : slab.tetrahedra) {
    for (std::uint32_t& node : corners) node += first;
    mesh.tetrahedra.push_back(corners);
    mesh.regions.push_back(0);
  }
  const BoundaryGroups groups = find_boundary_groups(mesh, surface_of(mesh), nullptr, right());
  EXPECT_NE(group_at(mesh, groups, kRightM, {0.5, 0.5, 0}), BoundaryGroup::kDiaphragm);
  EXPECT_EQ(groups[nearest(mesh, kRightM + Vector3(0.05, 0.075, -0.1))], BoundaryGroup::kDiaphragm);
}

TEST(BoundaryGroups, SideFrontAndTopAreRibCage) {
  const TetMesh mesh = box_lung(kRightM);
  const BoundaryGroups groups = find_boundary_groups(mesh, surface_of(mesh), nullptr, right());
  EXPECT_EQ(group_at(mesh, groups, kRightM, {0, 0.5, 0.5}), BoundaryGroup::kRibCage);
  EXPECT_EQ(group_at(mesh, groups, kRightM, {0.5, 0, 0.5}), BoundaryGroup::kRibCage);
  EXPECT_EQ(group_at(mesh, groups, kRightM, {0.5, 0.5, 1}), BoundaryGroup::kRibCage);
}

TEST(BoundaryGroups, WhatFacesTheBackIsBack) {
  const TetMesh mesh = box_lung(kRightM);
  const BoundaryGroups groups = find_boundary_groups(mesh, surface_of(mesh), nullptr, right());
  EXPECT_EQ(group_at(mesh, groups, kRightM, {0.5, 1, 0.5}), BoundaryGroup::kBack);
}

TEST(BoundaryGroups, TheHilumIsInTheMiddleOfTheMedialSurfaceAndTheRestOfThatIsFree) {
  const TetMesh mesh = box_lung(kRightM);
  const BoundaryGroups groups = find_boundary_groups(mesh, surface_of(mesh), nullptr, right());
  EXPECT_EQ(group_at(mesh, groups, kRightM, {1, 0.55, 0.55}), BoundaryGroup::kTrachea);
  EXPECT_EQ(group_at(mesh, groups, kRightM, {1, 0.5, 0.2}), BoundaryGroup::kFree);
  EXPECT_EQ(group_at(mesh, groups, kRightM, {1, 0.5, 0.8}), BoundaryGroup::kFree);
}

TEST(BoundaryGroups, WhichLungItIsMayBeSaid) {
  const TetMesh mesh = box_lung(kRightM);
  GroupRules rules;
  rules.side = LungSide::kLeft;
  const BoundaryGroups groups = find_boundary_groups(mesh, surface_of(mesh), nullptr, rules);
  EXPECT_EQ(group_at(mesh, groups, kRightM, {1, 0.5, 0.5}), BoundaryGroup::kRibCage);
  EXPECT_EQ(group_at(mesh, groups, kRightM, {0, 0.55, 0.55}), BoundaryGroup::kTrachea);
}

TEST(BoundaryGroups, ASingleLungLeansToItsMidlineWithItsApex) {
  for (const double lean : {1.0, -1.0}) {
    TetMesh mesh = box_lung(kRightM);
    for (Vector3& node : mesh.nodes) node.x() += 0.1 * lean * node.z();
    const BoundaryGroups groups = find_boundary_groups(mesh, surface_of(mesh), nullptr);
    std::size_t trachea_right = 0, trachea_left = 0;
    for (std::size_t node = 0; node < groups.size(); ++node) {
      if (groups[node] != BoundaryGroup::kTrachea) continue;
      const double middle_m = kRightM.x() + kSizeM.x() / 2 + 0.1 * lean * mesh.nodes[node].z();
      ++(mesh.nodes[node].x() > middle_m ? trachea_left : trachea_right);
    }
    EXPECT_EQ(trachea_left > 0, lean > 0);
    EXPECT_EQ(trachea_right > 0, lean < 0);
  }
}

TEST(BoundaryGroups, OfTwoLungsEachFacesTheOther) {
  const Vector3 left_m(0.02, 0, 0);
  TetMesh mesh = box_lung(kRightM);
  const TetMesh other = box_lung(left_m);
  const auto first = static_cast<std::uint32_t>(mesh.nodes.size());
  mesh.nodes.insert(mesh.nodes.end(), other.nodes.begin(), other.nodes.end());
  for (Tetrahedron corners : other.tetrahedra) {
    for (std::uint32_t& node : corners) node += first;
    mesh.tetrahedra.push_back(corners);
    mesh.regions.push_back(0);
  }
  const BoundaryGroups groups = find_boundary_groups(mesh, surface_of(mesh), nullptr);
  EXPECT_EQ(group_at(mesh, groups, kRightM, {1, 0.55, 0.55}), BoundaryGroup::kTrachea);
  EXPECT_EQ(group_at(mesh, groups, left_m, {0, 0.55, 0.55}), BoundaryGroup::kTrachea);
  EXPECT_EQ(group_at(mesh, groups, kRightM, {0, 0.5, 0.5}), BoundaryGroup::kRibCage);
  EXPECT_EQ(group_at(mesh, groups, left_m, {1, 0.5, 0.5}), BoundaryGroup::kRibCage);
  EXPECT_EQ(group_at(mesh, groups, kRightM, {0.5, 0.5, 0}), BoundaryGroup::kDiaphragm);
  EXPECT_EQ(group_at(mesh, groups, left_m, {0.5, 0.5, 0}), BoundaryGroup::kDiaphragm);
}

/// Voxels of 5 mm around the box, 5 cm more on each side.
LabelMap empty_labels() {
  LabelMap map;
  map.grid.size = {41, 51, 71};
  map.grid.spacing_m = Vector3::Constant(0.005);
  map.grid.origin_m = kRightM - Vector3::Constant(0.05);
  map.labels.assign(map.grid.voxels(), 0);
  return map;
}

/// In parts of the box.
void fill(LabelMap& map, const Vector3& least, const Vector3& greatest, std::uint16_t label) {
  std::size_t offset = 0;
  for (std::size_t k = 0; k < map.grid.size[2]; ++k) {
    for (std::size_t j = 0; j < map.grid.size[1]; ++j) {
      for (std::size_t i = 0; i < map.grid.size[0]; ++i, ++offset) {
        const Vector3 at =
            (map.grid.patient_m({double(i), double(j), double(k)}) - kRightM).cwiseQuotient(kSizeM);
        if ((at.array() >= least.array()).all() && (at.array() <= greatest.array()).all())
          map.labels[offset] = label;
      }
    }
  }
}

TEST(BoundaryGroups, LabelsSayWhatLiesBeyondTheSurface) {
  const TetMesh mesh = box_lung(kRightM);
  LabelMap labels = empty_labels();
  // Against what the shape says: the liver at the side, ribs below, the heart in front.
  fill(labels, {-0.2, 0, 0}, {-0.1, 1, 1}, 5);
  fill(labels, {0, 0, -0.15}, {1, 1, -0.05}, 100);
  fill(labels, {0, -0.2, 0}, {1, -0.1, 1}, 51);
  fill(labels, {1.1, 0.4, 0.4}, {1.15, 0.5, 1}, 16);
  const BoundaryGroups groups = find_boundary_groups(mesh, surface_of(mesh), &labels, right());
  EXPECT_EQ(group_at(mesh, groups, kRightM, {0, 0.5, 0.5}), BoundaryGroup::kDiaphragm);
  EXPECT_EQ(group_at(mesh, groups, kRightM, {0.5, 0.5, 0}), BoundaryGroup::kRibCage);
  EXPECT_EQ(group_at(mesh, groups, kRightM, {0.5, 0, 0.5}), BoundaryGroup::kFree);
  // The windpipe's lower end is the hilum; higher up it only lies beside the lung.
  EXPECT_EQ(group_at(mesh, groups, kRightM, {1, 0.5, 0.4}), BoundaryGroup::kTrachea);
  EXPECT_EQ(group_at(mesh, groups, kRightM, {1, 0.5, 0.8}), BoundaryGroup::kFree);
  // Nothing is labelled behind: the shape decides.
  EXPECT_EQ(group_at(mesh, groups, kRightM, {0.5, 1, 0.5}), BoundaryGroup::kBack);
}

TEST(BoundaryGroups, AMeshThatIsNoLungIsRefused) {
  // Upside down there is an underside still; but a lung without one, all labelled as ribs, has no diaphragm.
  const TetMesh mesh = box_lung(kRightM);
  LabelMap labels = empty_labels();
  for (std::uint16_t& label : labels.labels) label = 100;
  try {
    static_cast<void>(find_boundary_groups(mesh, surface_of(mesh), &labels, right()));
    FAIL() << "nothing would move it";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no part of the surface is taken for the diaphragm"));
  }
}

TEST(BoundaryGroups, NamesAreThoseOfDocuments) {
  for (const auto group : {BoundaryGroup::kFree, BoundaryGroup::kRibCage, BoundaryGroup::kDiaphragm,
                           BoundaryGroup::kTrachea, BoundaryGroup::kBack})
    EXPECT_EQ(boundary_group_named(name_of(group)), group);
  EXPECT_FALSE(boundary_group_named("inside"));
  EXPECT_FALSE(boundary_group_named("ribs"));
}

}  // namespace
}  // namespace kiroku::sim

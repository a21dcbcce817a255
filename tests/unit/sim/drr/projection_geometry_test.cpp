#include "sim/drr/projection_geometry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

GantrySetup clinic(double gantry_deg) {
  return {1, 1.5, {0.014, 0.008, -0.175}, gantry_deg, {512, 384}, {0.6, 0.45}};
}

ProjectionGeometry geometry_at(double gantry_deg) { return ProjectionGeometry(clinic(gantry_deg)); }

TEST(ProjectionGeometry, SourceTurnsAsTheGantryDoes) {
  const Vector3 isocenter = clinic(0).isocenter_m;
  const std::vector<std::pair<double, Vector3>> places{
      {0, {0, -1, 0}}, {90, {1, 0, 0}}, {180, {0, 1, 0}}, {270, {-1, 0, 0}}, {-90, {-1, 0, 0}}};
  for (const auto& [angle, from_isocenter] : places) {
    EXPECT_EQ((geometry_at(angle).source_m() - isocenter - from_isocenter).norm(), 0) << angle;
  }
  EXPECT_NEAR((geometry_at(30).source_m() - isocenter - Vector3(0.5, -std::sqrt(0.75), 0)).norm(), 0, 1e-15);
}

TEST(ProjectionGeometry, IsocentreIsTheMiddleAndMagnificationThatOfTheDistances) {
  for (const double angle : {0.0, 17.0, 90.0, 200.0}) {
    const ProjectionGeometry geometry = geometry_at(angle);
    const Vector3 isocenter = clinic(0).isocenter_m;
    const PixelPoint middle = *geometry.project(isocenter);
    EXPECT_NEAR(middle.column, 255.5, 1e-9);
    EXPECT_NEAR(middle.row, 191.5, 1e-9);
    EXPECT_NEAR(middle.depth_m, 1, 1e-12);
    // 100 mm to the head are 150 mm on the detector, 128 pixels, upwards.
    const PixelPoint head = *geometry.project(isocenter + Vector3(0, 0, 0.1));
    EXPECT_NEAR(head.row, 191.5 - 128, 1e-9);
    EXPECT_NEAR(head.column, 255.5, 1e-9);
  }
}

TEST(ProjectionGeometry, ColumnsRunAsSeenFromTheSource) {
  const Vector3 isocenter = clinic(0).isocenter_m;
  // From the front the patient's left is on the right; from the left side the back is.
  EXPECT_GT(geometry_at(0).project(isocenter + Vector3(0.1, 0, 0))->column, 256);
  EXPECT_GT(geometry_at(90).project(isocenter + Vector3(0, 0.1, 0))->column, 256);
  EXPECT_LT(geometry_at(180).project(isocenter + Vector3(0.1, 0, 0))->column, 255);
}

TEST(ProjectionGeometry, TheRayOfAPixelMeetsWhatIsProjectedOntoIt) {
  const ProjectionGeometry geometry = geometry_at(33);
  for (const auto& [column, row] : {std::pair{0.0, 0.0}, {511.0, 383.0}, {100.25, 300.5}}) {
    const SourceRay ray = geometry.ray(column, row);
    EXPECT_NEAR(ray.direction.norm(), 1, 1e-15);
    for (const double t : {0.2, 1.0, 1.7}) {
      const PixelPoint seen = *geometry.project(ray.origin_m + t * ray.direction);
      EXPECT_NEAR(seen.column, column, 1e-9);
      EXPECT_NEAR(seen.row, row, 1e-9);
    }
    EXPECT_FALSE(geometry.project(ray.origin_m - ray.direction).has_value());
  }
}

TEST(ProjectionGeometry, AMatrixSaysTheSameWhateverItsFactor) {
  const ProjectionGeometry gantry = geometry_at(120);
  const ProjectionGeometry scaled(gantry.matrix() * 17.5, {512, 384});
  EXPECT_NEAR((scaled.source_m() - gantry.source_m()).norm(), 0, 1e-12);
  const GeometryDocument document = parse_geometry(geometry_json(gantry), "g.json");
  EXPECT_FALSE(document.gantry.has_value());
  const Vector3 point(0.05, -0.02, -0.1);
  EXPECT_NEAR(document.geometry.project(point)->column, gantry.project(point)->column, 1e-9);
  EXPECT_NEAR(document.geometry.project(point)->row, gantry.project(point)->row, 1e-9);
  EXPECT_NEAR(document.geometry.project(point)->depth_m, gantry.project(point)->depth_m, 1e-12);
}

TEST(ProjectionGeometry, SeesAMovedPatientWhereTheyAre) {
  const ProjectionGeometry geometry = geometry_at(45);
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.rotate(Eigen::AngleAxisd(0.2, Vector3(1, 2, -1).normalized())).pretranslate(Vector3(0.01, 0.02, 0));
  const Vector3 point(0.03, 0.01, -0.2);
  const PixelPoint seen = *geometry.of_moved_patient(motion).project(point);
  const PixelPoint expected = *geometry.project(motion * point);
  EXPECT_NEAR(seen.column, expected.column, 1e-9);
  EXPECT_NEAR(seen.row, expected.row, 1e-9);
}

TEST(ProjectionGeometry, FewerPixelsShowTheSameField) {
  const ProjectionGeometry geometry = geometry_at(0), fewer = geometry.binned(4);
  EXPECT_EQ(fewer.columns(), 128U);
  EXPECT_EQ(fewer.rows(), 96U);
  const Vector3 point(0.05, -0.02, -0.1);
  EXPECT_NEAR(fewer.project(point)->column, (geometry.project(point)->column - 1.5) / 4, 1e-9);
  EXPECT_NEAR(fewer.project(point)->row, (geometry.project(point)->row - 1.5) / 4, 1e-9);
}

std::string refusal(const std::string& text) {
  try {
    static_cast<void>(parse_geometry(text, "g.json"));
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(ProjectionGeometry, ReadsADocument) {
  const GeometryDocument document = parse_geometry(
      R"({"sad_mm": 1000, "sid_mm": 1500, "isocenter_mm": [14, 8, -175], "gantry_deg": 90,
          "detector_px": [512, 384], "detector_mm": [600, 450]})",
      "g.json");
  EXPECT_EQ(document.geometry.columns(), 512U);
  EXPECT_NEAR((document.geometry.matrix() - geometry_at(90).matrix()).cwiseAbs().maxCoeff(), 0, 1e-9);
  ASSERT_TRUE(document.gantry.has_value());
  EXPECT_EQ(document.gantry->gantry_deg, 90);
}

TEST(ProjectionGeometry, RefusesWithTheJsonPath) {
  const auto with = [](const std::string& from, const std::string& to) {
    std::string text = R"({"sad_mm": 1000, "sid_mm": 1500, "isocenter_mm": [14, 8, -175], "gantry_deg": 90,
                           "detector_px": [512, 384], "detector_mm": [600, 450]})";
    text.replace(text.find(from), from.size(), to);
    return refusal(text);
  };
  EXPECT_THAT(with("[512, 384]", "[0, 384]"), HasSubstr("g.json: detector_px[0] is 0; it must be from 1"));
  EXPECT_THAT(with("[512, 384]", "[512]"), HasSubstr("detector_px has 1 elements, not 2"));
  EXPECT_THAT(with("[600, 450]", "[600, 0]"), HasSubstr("detector_mm[1] is 0; it must be more than 0"));
  EXPECT_THAT(with("1500", "900"), HasSubstr("sid_mm is 900, no more than sad_mm"));
  EXPECT_THAT(with("1000", "-1"), HasSubstr("sad_mm is -1"));
  EXPECT_THAT(with("\"gantry_deg\": 90", "\"gantry_deg\": 1e9"), HasSubstr("gantry_deg is 1e+09"));
  EXPECT_THAT(with("gantry_deg", "gantry_degrees"), HasSubstr("unknown key 'gantry_degrees'"));
  EXPECT_THAT(with("\"sad_mm\": 1000, ", ""), HasSubstr("lacks 'sad_mm'"));
  EXPECT_THAT(with("-175", "\"x\""), HasSubstr("isocenter_mm[2] is of type string"));
  EXPECT_THAT(refusal("["), HasSubstr("cannot read g.json: it is no JSON"));
  EXPECT_THAT(refusal(R"({"matrix": [[1,0,0,0],[0,1,0,0],[0,0,0,1]], "detector_px": [5, 5]})"),
              HasSubstr("g.json: matrix is no projection"));
  EXPECT_THAT(refusal(R"({"matrix": [[1,0,0,0],[1,0,0,0],[0,0,1,1]], "detector_px": [5, 5]})"),
              HasSubstr("has no inverse"));
  EXPECT_THAT(refusal(R"({"matrix": [[1,0,0],[1,0,0,0],[0,0,1,1]], "detector_px": [5, 5]})"),
              HasSubstr("matrix[0] has 3 elements, not 4"));
}

std::array<Vector3, 8> box_at(const Vector3& centre, double half) {
  std::array<Vector3, 8> corners;
  for (unsigned i = 0; i < 8; ++i) {
    corners[i] =
        centre + half * Vector3((i & 1U) != 0 ? 1 : -1, (i & 2U) != 0 ? 1 : -1, (i & 4U) != 0 ? 1 : -1);
  }
  return corners;
}

std::string unseen(const ProjectionGeometry& geometry, const std::array<Vector3, 8>& corners) {
  try {
    refuse_unseen(geometry, corners, "the volume");
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(ProjectionGeometry, RefusesASourceInsideThePatient) {
  const ProjectionGeometry geometry = geometry_at(0);
  const Vector3 isocenter = clinic(0).isocenter_m;
  EXPECT_EQ(unseen(geometry, box_at(isocenter, 0.2)), "");
  EXPECT_THAT(unseen(geometry, box_at(geometry.source_m(), 0.2)),
              HasSubstr("the source is inside the volume"));
  EXPECT_THAT(unseen(geometry, box_at(isocenter - Vector3(0, 3, 0), 0.2)),
              HasSubstr("the volume is behind the source"));
  EXPECT_THAT(unseen(geometry, box_at(isocenter + Vector3(0, 0.4, 0), 0.2)),
              HasSubstr("the detector is inside the volume"));
}

}  // namespace
}  // namespace kiroku::sim

// A lung that was moved by a known motion is found again in a mask of it; landmarks.
#include "sim/respiration/shape_fit.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/respiration/sliding_boundary.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/sim/respiration/box_lung.h"
#include "tests/unit/sim/respiration/two_lungs.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

Eigen::Isometry3d moved_patient() {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.translate(Vector3(0.012, -0.02, 0.03));
  motion.rotate(Eigen::AngleAxisd(0.03, Vector3(1, 0.4, -0.2).normalized()));
  return motion;
}

struct Truth {
  Eigen::VectorXd displacement_m;
  LabelMap mask;
};

/// The lung as the motion leaves it at its amplitudes, on voxels of 2 mm of another patient position.
Truth moved_lung(const BreathingModel& model, double rib_cage_m, double diaphragm_m) {
  const BreathingBody body(model.mesh, model.materials, model.groups, model.slide);
  Truth truth;
  truth.displacement_m = rib_cage_m * body.response(BoundaryGroup::kRibCage, std::nullopt) +
                         diaphragm_m * body.response(BoundaryGroup::kDiaphragm, std::nullopt);
  std::vector<Vector3> places;
  for (std::size_t node = 0; node < model.mesh.nodes.size(); ++node) {
    places.push_back(moved_patient() * (model.mesh.nodes[node] + truth.displacement_m.segment<3>(
                                                                     static_cast<Eigen::Index>(3 * node))));
  }
  truth.mask.grid.size = {80, 100, 160};
  truth.mask.grid.spacing_m = Vector3::Constant(0.002);
  truth.mask.grid.origin_m = Vector3(-0.14, -0.04, -0.01);
  std::vector<std::uint8_t> marked(truth.mask.grid.voxels());
  mark_voxels(places, model.mesh.tetrahedra, truth.mask.grid, marked);
  truth.mask.labels.assign(marked.begin(), marked.end());
  return truth;
}

/// Of inner nodes.
LandmarkPairs landmarks(const BreathingModel& model, const Truth& truth) {
  LandmarkPairs pairs;
  for (std::size_t node = 0; node < model.mesh.nodes.size(); ++node) {
    if (model.groups[node] != BoundaryGroup::kInside) continue;
    pairs.fixed_m.push_back(model.mesh.nodes[node]);
    pairs.moving_m.push_back(
        moved_patient() *
        (model.mesh.nodes[node] + truth.displacement_m.segment<3>(static_cast<Eigen::Index>(3 * node))));
  }
  return pairs;
}

TEST(ShapeFit, FindsTheMotionThatMadeTheSecondShape) {
  const BreathingModel model = test::box_lung_model();
  const Truth truth = moved_lung(model, 0.006, 0.015);
  const ShapeFitResult found = fit_shape(model, truth.mask, {});
  ASSERT_EQ(found.steps.size(), 4U);
  EXPECT_NEAR(found.motion.rib_cage.amplitude_m, 0.006, 0.05 * 0.006);
  EXPECT_NEAR(found.motion.diaphragm.amplitude_m, 0.015, 0.05 * 0.015);
  RecordProperty("rib_cage_mm", std::to_string(1000 * found.motion.rib_cage.amplitude_m));
  RecordProperty("diaphragm_mm", std::to_string(1000 * found.motion.diaphragm.amplitude_m));
  const LandmarkErrors errors = errors_at(landmarks(model, truth), model.mesh, found.steps);
  EXPECT_EQ(errors.outside, 0U);
  const double model_m = spread_of(errors.of_step_m[1]).mean,
               sliding_m = spread_of(errors.of_step_m.back()).mean;
  EXPECT_LT(model_m, 0.0005);
  // A box is the worst case: nothing on its faces says how far it has slid along them.
  EXPECT_LT(sliding_m, 0.003);
  EXPECT_GT(spread_of(errors.before_m).mean, 0.03);
  RecordProperty("model_mm", std::to_string(1000 * model_m));
  RecordProperty("sliding_mm", std::to_string(1000 * sliding_m));
}

/// Five fits take minutes there.
#if defined(__SANITIZE_ADDRESS__)
constexpr bool kUnderSanitizer = true;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
constexpr bool kUnderSanitizer = true;
#else
constexpr bool kUnderSanitizer = false;
#endif
#else
constexpr bool kUnderSanitizer = false;
#endif

TEST(ShapeFit, CrossValidationTellsOfEachPointWhereItWasLeftOut) {
  if (kUnderSanitizer) GTEST_SKIP() << "takes minutes under the address sanitizer";
  BreathingModel model = test::box_lung_model();
  BreathingModel longer = model;
  for (Vector3& node : longer.mesh.nodes) node.z() *= 1.05;
  const Truth truth = moved_lung(longer, 0, 0);
  ShapeFitOptions options;
  options.cross_validate = true;
  const ShapeFitResult found = fit_shape(model, truth.mask, options);
  ASSERT_TRUE(found.left_out_m);
  const SurfacePoints points = points_on(signed_distance(truth.mask));
  // Each is left out once. The fit puts air around the mask, which moves a few points to another cell.
  const auto count = static_cast<double>(points.places_m.size());
  EXPECT_NEAR(static_cast<double>(found.left_out_m->count), count, 0.01 * count);
  const auto left_m = [&](const ShapeFitStep& step) {
    return spread_of(distances_to_lung_m(model.mesh, surface_of(model.mesh), points, step.placement,
                                         step.displacement_m, [](const Vector3&) { return true; }))
        .mean;
  };
  // Worse than where it was fitted, better than what it began with.
  EXPECT_GT(found.left_out_m->mean, left_m(found.steps.back()));
  EXPECT_LT(found.left_out_m->mean, 0.8 * left_m(found.steps[1]));
  EXPECT_FALSE(fit_shape(model, truth.mask, {}).left_out_m);
}

TEST(ShapeFit, TheSlidingBoundaryComesToTheSecondSurface) {
  // A motion that the model does not know: the lung as a whole a tenth longer.
  BreathingModel model = test::box_lung_model();
  BreathingModel longer = model;
  for (Vector3& node : longer.mesh.nodes) node.z() *= 1.1;
  const Truth truth = moved_lung(longer, 0, 0);
  const ShapeFitResult found = fit_shape(model, truth.mask, {});
  EXPECT_LT(found.steps.back().surface_m.mean, 0.4 * found.steps[1].surface_m.mean);
  EXPECT_LT(found.steps.back().surface_m.mean, 0.001);
  EXPECT_NEAR(found.steps.back().volume_m3 / found.second_volume_m3, 1, 0.03);
  EXPECT_EQ(found.steps.back().inverted, 0U);
}

TEST(ShapeFit, GivesTheSameBitsTwice) {
  const BreathingModel model = test::box_lung_model();
  const Truth truth = moved_lung(model, 0.004, 0.01);
  EXPECT_EQ(fit_shape(model, truth.mask, {}).steps.back().displacement_m,
            fit_shape(model, truth.mask, {}).steps.back().displacement_m);
}

std::string refusal_of_fit(const std::function<void()>& what) {
  try {
    what();
  } catch (const Error& error) {
    return error.what();
  }
  return "taken";
}

TEST(ShapeFit, AnotherOrganIsRefused) {
  const BreathingModel model = test::box_lung_model();
  LabelMap mask = moved_lung(model, 0, 0).mask;
  mask.grid.spacing_m *= 0.1;
  EXPECT_THAT(refusal_of_fit([&] { static_cast<void>(fit_shape(model, mask, {})); }),
              HasSubstr("not the same lung"));
  std::ranges::fill(mask.labels, std::uint16_t{0});
  EXPECT_THAT(refusal_of_fit([&] { static_cast<void>(fit_shape(model, mask, {})); }),
              HasSubstr("not the same lung"));
}

TEST(ShapeFit, ABreathThatMoreThanDoublesTheLungsEndsInTheRightPlace) {
  // From the rigid motion or the model the boundary slides to a wrong place here: half of the volume, 72 mm
  // off.
  const auto motion = [](const Vector3& p) {
    const Vector3 q = test::breathed_in(p);
    return Vector3(1.07 * q.x(), 1.2 * (q.y() - 0.05) + 0.05, 0.17 + 1.3 * (q.z() - 0.17));
  };
  const BreathingModel model = test::two_lungs_model();
  const ShapeFitResult found = fit_shape(model, test::mask_of_two_lungs(motion), {});
  EXPECT_EQ(found.refusal, "");
  const ShapeFitStep& last = found.steps.back();
  EXPECT_GT(found.second_volume_m3 / found.first_volume_m3, 2.5);
  EXPECT_EQ(last.inverted, 0U);
  EXPECT_NEAR(last.volume_m3 / found.second_volume_m3, 1, kMostVolumeError);
  EXPECT_LT(last.surface_m.mean, 0.001);
  LandmarkPairs landmarks = test::breath_landmarks();
  for (std::size_t i = 0; i < landmarks.fixed_m.size(); ++i)
    landmarks.moving_m[i] = motion(landmarks.fixed_m[i]);
  const LandmarkErrors errors = errors_at(landmarks, model.mesh, found.steps);
  const double before_m = spread_of(errors.before_m).mean, after_m = spread_of(errors.of_step_m.back()).mean;
  RecordProperty("before_mm", std::to_string(1000 * before_m));
  RecordProperty("after_mm", std::to_string(1000 * after_m));
  EXPECT_GT(before_m, 0.08);
  EXPECT_LT(after_m, 0.02);
  EXPECT_THAT(found.warnings,
              testing::ElementsAre(HasSubstr("elements inside out: this breath is too deep")));
}

TEST(ShapeFit, CorrespondencesTellWhereTheInsideOfADeepBreathWent) {
  const BreathingModel model = test::two_lungs_model();
  const LabelMap mask = test::mask_of_two_lungs(test::breathed_in);
  const LandmarkPairs truth = test::breath_landmarks();
  // A third of them, each seventh of which is wrong; the error is told at the others.
  ShapeFitOptions options;
  options.correspondences.emplace();
  LandmarkPairs judged;
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < truth.fixed_m.size(); ++i) {
    if (i % 3 != 0) {
      judged.fixed_m.push_back(truth.fixed_m[i]);
      judged.moving_m.push_back(truth.moving_m[i]);
      continue;
    }
    Vector3 moving_m = truth.moving_m[i];
    if (i % 21 == 0) {
      moving_m += Vector3(0.015, -0.01, 0.012);
      ++wrong;
    }
    options.correspondences->first_m.push_back(truth.fixed_m[i]);
    options.correspondences->second_m.push_back(moving_m);
  }
  const ShapeFitResult found = fit_shape(model, mask, options);
  EXPECT_EQ(found.refusal, "");
  EXPECT_EQ(found.steps.back().inverted, 0U);
  const double error_m = spread_of(errors_at(judged, model.mesh, found.steps).of_step_m.back()).mean;
  RecordProperty("error_mm", std::to_string(1000 * error_m));
  EXPECT_LT(error_m, 0.0012);
  ASSERT_TRUE(found.correspondences);
  EXPECT_NEAR(static_cast<double>(found.correspondences->refused), static_cast<double>(wrong),
              0.1 * static_cast<double>(wrong));
}

TEST(ShapeFit, WhatIsNotTheLungIsRefusedWithItsNumbers) {
  // A block of about the lungs' volume, with a hole through it.
  LabelMap mask = test::mask_of_two_lungs([](const Vector3& p) { return p; });
  const Grid& grid = mask.grid;
  const auto middle = [&](std::size_t index, std::size_t axis) {
    return std::abs(2 * static_cast<double>(index) - static_cast<double>(grid.size[axis])) <
           0.3 * static_cast<double>(grid.size[axis]);
  };
  const auto edge = [&](std::size_t index, std::size_t axis) {
    return index < 3 || index + 3 >= grid.size[axis];
  };
  for (std::size_t k = 0; k < grid.size[2]; ++k) {
    for (std::size_t j = 0; j < grid.size[1]; ++j) {
      for (std::size_t i = 0; i < grid.size[0]; ++i) {
        const bool lung = !edge(i, 0) && !edge(j, 1) && !edge(k, 2) && !(middle(i, 0) && middle(j, 1));
        mask.labels[grid.offset(i, j, k)] = lung ? 1 : 0;
      }
    }
  }
  const ShapeFitResult found = fit_shape(test::two_lungs_model(), mask, {});
  EXPECT_THAT(found.refusal, testing::AllOf(HasSubstr("the lung could not be brought to the second shape"),
                                            HasSubstr("ml and the mask's"), HasSubstr("at most 2 %")));
}

TEST(Landmarks, ListsAndElastixFilesAreRead) {
  const auto bare = parse_landmarks_m("# mm\n1 2 3\n\n-4,5.5,\t6e1\n", "a.txt");
  ASSERT_EQ(bare.size(), 2U);
  EXPECT_EQ(bare[1], Vector3(-0.004, 0.0055, 0.06));
  const auto elastix = parse_landmarks_m("point\n2\n1 2 3\n4 5 6\n", "a.txt");
  ASSERT_EQ(elastix.size(), 2U);
  EXPECT_EQ(elastix[0], bare[0]);
}

TEST(Landmarks, WhatIsWrongIsToldByItsLine) {
  const auto parse = [](const std::string& text) {
    return refusal_of_fit([&] { static_cast<void>(parse_landmarks_m(text, "a.txt")); });
  };
  EXPECT_THAT(parse("1 2 3\n4 5\n"),
              HasSubstr("cannot use a.txt, line 2: it has 2 words where x y z are expected"));
  EXPECT_THAT(parse("1 2 z\n"), HasSubstr("line 1: 'z' is no number"));
  EXPECT_THAT(parse("1 2 inf\n"), HasSubstr("'inf' is no number"));
  EXPECT_THAT(parse("point\n3\n1 2 3\n"), HasSubstr("it says that it has 3 points and has 1"));
  EXPECT_THAT(parse("index\n1\n1 2 3\n"), HasSubstr("it counts voxels"));
  EXPECT_THAT(parse("point\nmany\n"), HasSubstr("the number of points is expected here"));
}

TEST(Landmarks, EachMustHaveItsPartner) {
  const test::TemporaryFolder folder;
  const auto write = [&](const char* name, const std::string& text) {
    std::ofstream(folder.path() / name) << text;
    return folder.path() / name;
  };
  const auto fixed = write("fixed.txt", "1 2 3\n4 5 6\n"), moving = write("moving.txt", "1 2 3\n"),
             none = write("none.txt", "");
  EXPECT_THAT(refusal_of_fit([&] { static_cast<void>(read_landmark_pairs(fixed, moving)); }),
              HasSubstr("fixed.txt has 2 landmarks and"));
  EXPECT_THAT(refusal_of_fit([&] { static_cast<void>(read_landmark_pairs(none, none)); }),
              HasSubstr("hold no landmark"));
}

TEST(Landmarks, ASpreadIsThatOfItsNumbers) {
  const Spread spread = spread_of({4, 1, 2, 3, 5});
  EXPECT_EQ(spread.count, 5U);
  EXPECT_DOUBLE_EQ(spread.mean, 3);
  EXPECT_DOUBLE_EQ(spread.deviation, std::sqrt(2.5));
  EXPECT_DOUBLE_EQ(spread.median, 3);
  EXPECT_DOUBLE_EQ(spread.greatest, 5);
  EXPECT_EQ(spread_of({}).mean, 0);
}

TEST(MeshPoint, APointGoesWithTheElementItIsIn) {
  const TetMesh mesh = test::tet_grid({2, 2, 2}, {0.02, 0.02, 0.02});
  const Vector3 place(0.013, 0.004, 0.009);
  const MeshLocator locator(mesh);
  const LocatedPoint inside = locator.locate(place);
  EXPECT_EQ(inside.outside_m, 0);
  EXPECT_LT((inside.point.mean(mesh.nodes) - place).norm(), 1e-15);
  const LocatedPoint outside = locator.locate({0.01, 0.01, 0.023});
  EXPECT_NEAR(outside.outside_m, 0.003, 0.0015);
  EXPECT_LT((outside.point.mean(mesh.nodes) - Vector3(0.01, 0.01, 0.023)).norm(), 1e-15);
}

}  // namespace
}  // namespace kiroku::sim

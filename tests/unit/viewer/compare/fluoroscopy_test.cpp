// A fluoroscope's pictures of a plan that is carried out on a patient who lies aside: where they lay is
// known.
#include "viewer/compare/fluoroscopy.h"

#include <cmath>
#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "media/film_writer.h"
#include "sim/mesh/mesh_writer.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/recorded_case.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tet_grid.h"
#include "viewer/compare/comparison.h"
#include "viewer/compare/paired_radiographs.h"

namespace kiroku::compare {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr int kSide = 160, kRate = 10;

class FluoroscopyOfAPlan : public testing::Test {
 protected:
  FluoroscopyOfAPlan()
      : geometry_(sim::GantrySetup{.source_axis_m = 1,
                                   .source_imager_m = 1.5,
                                   .isocenter_m = {0.04, 0.012, 0.03},
                                   .gantry_deg = 0,
                                   .pixels = {kSide, kSide},
                                   .size_m = {0.18, 0.18},
                                   .offset_m = {0, 0}}) {
    // A slab of 80 x 24 x 60 mm with three spots, pressed in by 9 mm within a second.
    std::ofstream(folder_ / "slab.msh")
        << sim::msh_text(test::tet_grid({10, 4, 8}, {0.08, 0.024, 0.06}), sim::LengthUnit::kMillimetre);
    const sim::Volume ct =
        test::volume_of({90, 34, 70}, 1e-3, sim::Vector3::Constant(-0.005), [](const sim::Vector3& at) {
          const sim::Vector3 mm = at * 1000;
          const auto spot = [&](double x, double z, double wide) {
            return std::exp(-((mm.x() - x) * (mm.x() - x) + (mm.z() - z) * (mm.z() - z)) / (wide * wide));
          };
          const bool inside =
              mm.x() > 0 && mm.x() < 80 && mm.y() > 0 && mm.y() < 24 && mm.z() > 0 && mm.z() < 60;
          return inside ? 60 + 500 * spot(30, 20, 12) - 400 * spot(60, 42, 10) + 300 * spot(14, 48, 7)
                        : -1000;
        });
    std::ofstream(folder_ / "plan.json") << nlohmann::json{
        {"name", "slab"},
        {"mesh", "slab.msh"},
        {"length_unit", "mm"},
        {"time_step_s", 0.1},
        {"materials", {{{"region", "all"}, {"young_modulus_pa", 8000}, {"poisson_ratio", 0.4}}}},
        {"fixed", {{{"box", {{0, 24, 0}, {80, 24, 60}}}}}},
        {"tools", {{"finger", {{"kind", "finger"}, {"radius", 12}}}}},
        {"steps",
         {{{"do", "press"},
           {"name", "press"},
           {"tool", "finger"},
           {"path",
            {{{"at_s", 0}, {"position", {40, -12.5, 30}}}, {{"at_s", 1}, {"position", {40, -3, 30}}}}}}}}};
    sim::PlanReading reading = sim::read_plan(folder_ / "plan.json");
    EXPECT_THAT(reading.errors, testing::IsEmpty());
    plan_ = std::move(reading.plan);
    frames_.emplace(*plan_);
    radiographs_.emplace(*plan_, ct);
    comparison_.stream = "fluoroscopy";
    comparison_.recording_end_ns = kSecond;
    comparison_.steps = planned_steps(*plan_);
    StepMatch whole;
    whole.span = {0, kSecond};
    whole.start_from = whole.end_from = KnownFrom::kHand;
    comparison_.matching = match_by_hand(comparison_.steps, {whole}, kSecond);
    comparison_.map.emplace(comparison_.steps, comparison_.matching);
  }

  /// A second of pictures as a fluoroscope shows them, in eight bits, dark where much attenuates.
  archive::CaseReader record(const sim::ProjectionGeometry& seen_by) {
    const sim::Window window{0, 1.6};
    media::FilmWriter writer(folder_ / "second.mkv", {kSide, kSide, 1, kRate, 1}, true);
    for (int i = 0; i < kRate; ++i) {
      const sim::ProjectionImage image =
          radiographs_->project(frames_->at(0, double(i) / kRate + 1e-9), seen_by);
      const sim::GreyPicture picture =
          sim::picture_of(image, sim::Response::kFilm, window, sim::Polarity::kBoneBlack);
      std::vector<std::uint8_t> samples;
      for (const std::uint16_t grey : picture.values)
        samples.push_back(static_cast<std::uint8_t>(grey >> 8U));
      writer.add({kSide, kSide, 1, samples});
    }
    writer.finish();
    std::ifstream in(folder_ / "second.mkv", std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(in), {}};
    test::RecordedStream film{"fluoroscopy", "video", "video/x-matroska", {}, {}};
    film.segments.push_back(to_bytes(text));
    film.units.push_back(kRate);
    return archive::CaseReader::open(test::record_case(folder_ / "archive", {film}, reader_.recipients));
  }

  [[nodiscard]] Fluoroscopy compared(const archive::CaseReader& recording, bool align) {
    return compare_fluoroscopy(recording, reader_.identities, *comparison_.map, *frames_, *radiographs_,
                               {"fluoroscopy", geometry_, sim::Polarity::kBoneBlack, kSecond / 2, align});
  }

  /// Mean difference of red and blue: nothing where both radiographs agree.
  [[nodiscard]] double colour_of_difference(const archive::CaseReader& recording, const Fluoroscopy& found) {
    PairedRadiographs paired(recording, reader_.identities, comparison_, found, *frames_, *radiographs_,
                             RadiographForm::kDifference, 0.5, 0, kSecond);
    const sim::Picture picture = paired.at(kSecond / 2);
    const int top = (picture.height - kSide) / 3;  // a line of text above, two below
    double sum = 0;
    for (int y = top; y < top + kSide; ++y) {
      for (int x = 0; x < kSide; ++x) sum += std::abs(picture.pixel(x, y)[0] - picture.pixel(x, y)[2]);
    }
    return sum / (kSide * kSide);
  }

  test::TemporaryFolder folder_;
  test::Reader reader_ = test::make_reader();
  sim::ProjectionGeometry geometry_;
  std::optional<sim::Plan> plan_;
  std::optional<sim::PlanFrames> frames_;
  std::optional<PlanRadiographs> radiographs_;
  Comparison comparison_;
};

TEST_F(FluoroscopyOfAPlan, FindsWhereThePatientLay) {
  const Eigen::Isometry3d aside(Eigen::Translation3d(0.004, 0, -0.005));
  const sim::ProjectionGeometry truth = geometry_.of_moved_patient(aside);
  const archive::CaseReader recording = record(truth);
  const Fluoroscopy as_given = compared(recording, false), found = compared(recording, true);
  EXPECT_FALSE(as_given.alignment.has_value());
  ASSERT_TRUE(found.alignment);
  EXPECT_EQ(found.at_ns, kSecond / 2);
  EXPECT_NEAR(found.plan_s, 0.5, 1e-9);
  EXPECT_NEAR(found.similarity, found.alignment->similarity_before, 1e-6);
  EXPECT_LT(found.similarity, 0.8);
  EXPECT_GT(found.alignment->similarity_after, 0.98);
  // 4 mm to the left and 5 mm to the feet, as far as the detector shows it.
  double most = 0;
  for (const sim::Vector3& point : {sim::Vector3(0.01, 0.012, 0.01), sim::Vector3(0.07, 0.012, 0.05)}) {
    const sim::PixelPoint expected = *truth.project(point), seen = *found.geometry.project(point);
    most = std::max({most, std::abs(seen.column - expected.column), std::abs(seen.row - expected.row)});
  }
  EXPECT_LT(most, 0.5) << "pixels of 0.75 mm at the isocentre";
  EXPECT_NEAR(found.alignment->translation_m.x(), 0.004, 4e-4);
  EXPECT_NEAR(found.alignment->translation_m.z(), -0.005, 4e-4);
  RecordProperty("pixels_off", std::to_string(most));
  const double before = colour_of_difference(recording, as_given),
               after = colour_of_difference(recording, found);
  EXPECT_LT(after, before / 4) << "before " << before << ", after " << after;
}

TEST_F(FluoroscopyOfAPlan, FollowsThePlanAsTissueIsPressed) {
  const sim::ProjectionImage rest = radiographs_->project(frames_->at(0, 0), geometry_),
                             pressed = radiographs_->project(frames_->at(0, 1), geometry_);
  double most = 0;
  for (std::size_t i = 0; i < rest.values.size(); ++i)
    most = std::max(most, double(std::abs(rest.values[i] - pressed.values[i])));
  EXPECT_GT(most, 0.05);
  const archive::CaseReader recording = record(geometry_);
  const Fluoroscopy found = compared(recording, false);
  EXPECT_GT(found.similarity, 0.98);
  for (const auto& [form, wide] : {std::pair{RadiographForm::kBeside, 2 * kSide + 8},
                                   {RadiographForm::kWipe, kSide},
                                   {RadiographForm::kOpacity, kSide},
                                   {RadiographForm::kCheckerboard, kSide},
                                   {RadiographForm::kContour, kSide}}) {
    PairedRadiographs paired(recording, reader_.identities, comparison_, found, *frames_, *radiographs_, form,
                             0.5, 0, kSecond);
    EXPECT_EQ(paired.width(), wide);
    EXPECT_EQ(paired.at(kSecond / 2).width, wide);
  }
}

TEST_F(FluoroscopyOfAPlan, SaysWhatCannotBeCompared) {
  const archive::CaseReader recording = record(geometry_);
  const auto with = [&](const sim::ProjectionGeometry& geometry, std::int64_t at_ns) {
    return [&, geometry, at_ns] {
      (void)compare_fluoroscopy(recording, reader_.identities, *comparison_.map, *frames_, *radiographs_,
                                {"fluoroscopy", geometry, sim::Polarity::kBoneBlack, at_ns, false});
    };
  };
  EXPECT_THAT(with(geometry_.binned(2), 0),
              ThrowsMessage<UsageError>(HasSubstr("have 160 x 160 pixels, the geometry 80 x 80")));
  EXPECT_THAT(with(geometry_, 9 * kSecond), ThrowsMessage<UsageError>(HasSubstr("no picture at that time")));
  EXPECT_EQ(fluoroscopy_of(recording, {}, "--stream"), "fluoroscopy") << "by its purpose";
  EXPECT_THAT([&] { (void)fluoroscopy_of(recording, "none", "--stream"); }, testing::Throws<UsageError>());
}

}  // namespace
}  // namespace kiroku::compare

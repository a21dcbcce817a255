// A recorded operation in which the organ's place is known: the plan is laid on it, and the document and the
// film say where, how well, and where not.
#include "viewer/compare/organ_alignment.h"

#include <algorithm>
#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "base/error.h"
#include "media/film_writer.h"
#include "sim/mesh/mesh_writer.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/endoscope_scene.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/recorded_case.h"
#include "tests/support/temporary_folder.h"
#include "viewer/api/alignment_fields.h"
#include "viewer/compare/comparison_document.h"
#include "viewer/compare/paired_pictures.h"
#include "viewer/kept/kept_comparison.h"

namespace kiroku::compare {
namespace {

using test::EndoscopeScene;
using testing::HasSubstr;

constexpr int kPictures = 10;  // a second
constexpr std::int64_t kTenthNs = kSecond / kPictures;
/// From that picture on there is smoke, to the end of the first second. The second one has pictures of half
/// the size.
constexpr int kSmokeFrom = 6;

class OrganAlignment : public testing::Test {
 protected:
  [[nodiscard]] sim::Camera truth(double picture) const {
    return scene_.camera(8 + 0.6 * picture, -18, 0.16, 5);
  }

  [[nodiscard]] Bytes second(int number) {
    const bool small = number > 0;
    const int width = EndoscopeScene::kWidth / (small ? 2 : 1),
              height = EndoscopeScene::kHeight / (small ? 2 : 1);
    media::FilmWriter writer(folder_ / "second.mkv", {width, height, 3, kPictures, 1}, true);
    for (int i = 0; i < kPictures; ++i) {
      EndoscopeScene::Look look;
      look.camera = truth(number * kPictures + i);
      look.smoke = !small && i >= kSmokeFrom ? 1 : 0;
      const sim::Picture whole = scene_.picture(look);
      sim::Picture shown(width, height);
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x)
          std::copy_n(whole.pixel(small ? 2 * x : x, small ? 2 * y : y), 3, shown.pixel(x, y));
      }
      writer.add({width, height, 3, shown.rgb});
    }
    writer.finish();
    std::ifstream in(folder_ / "second.mkv", std::ios::binary);
    return to_bytes(std::string{std::istreambuf_iterator<char>(in), {}});
  }

  [[nodiscard]] archive::CaseReader record() {
    const test::RecordedStream film{
        "endoscope", "video", "video/x-matroska", {second(0), second(1)}, {kPictures, kPictures}};
    return archive::CaseReader::open(test::record_case(folder_ / "archive", {film}, reader_.recipients));
  }

  /// The organ is held still for two seconds.
  [[nodiscard]] sim::Plan plan() const {
    std::ofstream(folder_ / "liver.msh") << sim::msh_text(mesh_, sim::LengthUnit::kMillimetre);
    const auto at = [](double x, double y, double z) { return nlohmann::json{x, y, z}; };
    nlohmann::json document{
        {"name", "liver"},
        {"mesh", "liver.msh"},
        {"length_unit", "mm"},
        {"time_step_s", 0.5},
        {"materials", {{{"region", "all"}, {"young_modulus_pa", 8000}, {"poisson_ratio", 0.4}}}},
        {"fixed", {{{"box", {at(-100, -100, 20), at(100, 100, 100)}}}}},
        {"tools", {{"first", {{"kind", "finger"}, {"radius", 7}}}}}};
    document["steps"] = {{{"do", "hold"}, {"name", "hold"}, {"duration_s", 2}}};
    std::ofstream(folder_ / "plan.json") << document;
    sim::PlanReading reading = sim::read_plan(folder_ / "plan.json");
    EXPECT_THAT(reading.errors, testing::IsEmpty());
    return *reading.plan;
  }

  EndoscopeScene scene_{test::liver_like_mesh({32, 10, 24})};
  sim::TetMesh mesh_ = test::liver_like_mesh({16, 5, 12});
  sim::OrganSurface surface_ = sim::organ_surface(mesh_);
  test::TemporaryFolder folder_;
  test::Reader reader_ = test::make_reader();
};

TEST_F(OrganAlignment, OfARecordedCaseIsToldInDocumentAndFilm) {
  const archive::CaseReader recording = record();
  const AlignmentRequest request{{0, 2 * kSecond}, EndoscopeScene::kFieldDeg, {}};
  const Alignment found = align_organ(recording, reader_.identities, "endoscope", mesh_, request);
  ASSERT_EQ(found.moments.size(), 2U * kPictures);
  for (int i = 0; i < 2 * kPictures; ++i) {
    const sim::AlignedMoment& moment = found.moments[static_cast<std::size_t>(i)];
    const bool smoke = i >= kSmokeFrom && i < kPictures;
    ASSERT_EQ(moment.held(), !smoke) << i << ": " << sim::name_of(moment.why);
    if (!smoke) {
      EXPECT_LT(sim::way_between_m(surface_, moment.camera, truth(i)), 4e-3) << i;
    }
  }
  // Between two pictures, beside the smoke, and beyond.
  const auto between = found.at(2 * kTenthNs + kTenthNs / 2);
  ASSERT_TRUE(between && between->held());
  EXPECT_LT(sim::way_between_m(surface_, between->camera, truth(2.5)), 3e-3);
  EXPECT_NEAR((between->camera.eye_m - found.moments[2].camera.eye_m).norm(),
              (between->camera.eye_m - found.moments[3].camera.eye_m).norm(), 1e-9);
  EXPECT_EQ(between->standard_error_m,
            std::max(found.moments[2].standard_error_m, found.moments[3].standard_error_m));
  const auto beside = found.at(kSmokeFrom * kTenthNs - kTenthNs / 2);
  ASSERT_TRUE(beside);
  EXPECT_FALSE(beside->held());
  EXPECT_FALSE(found.at(2 * kSecond));
  EXPECT_FALSE(found.at(-1));

  const sim::Plan plan = this->plan();
  const sim::PlanFrames frames(plan);
  ByHand by_hand;
  by_hand.steps.emplace().emplace_back().span = {0, 2 * kSecond};
  Comparison comparison = compare(recording, reader_.identities, "endoscope", plan, by_hand, {});
  ASSERT_TRUE(comparison.map);
  comparison.alignment = found;
  const auto told = nlohmann::json::parse(comparison_json(comparison, plan, {}))["organ_alignment"];
  EXPECT_EQ(told["pictures"], 2 * kPictures);
  EXPECT_EQ(told["held"], kPictures + kSmokeFrom);
  EXPECT_EQ(told["lost"][0]["start_ns"], kSmokeFrom * kTenthNs);
  EXPECT_EQ(told["lost"].back()["end_ns"], kSecond);
  EXPECT_TRUE(told["moments"][0].contains("standard_error_mm"));
  EXPECT_FALSE(told["moments"][kSmokeFrom].contains("eye_m"));
  // By which the page draws the outline.
  EXPECT_EQ(told["picture_sizes"], nlohmann::json::parse(R"([{"from_ns": 0, "width": 640, "height": 480},
                                      {"from_ns": 1000000000, "width": 320, "height": 240}])"));
  EXPECT_EQ(told["surface"]["moved_mm"], 0);
  ASSERT_EQ(told["surface"]["nodes_mm"].size(), 3 * surface_.nodes.size());
  EXPECT_NEAR(told["surface"]["nodes_mm"][5].get<double>(), 1000 * surface_.nodes[1].z(), 0.005);
  ASSERT_EQ(told["surface"]["faces"].size(), 3 * surface_.faces.size());
  EXPECT_EQ(told["surface"]["faces"][4], surface_.faces[1][1]);

  // On the film's pictures. Nobody looked at what is outside of the stretch that was aligned.
  comparison.alignment->moments.resize(kPictures + 2);
  constexpr int kFilmWidth = 320, kFilmHeight = 240;
  sim::Scene scene;
  scene.width = kFilmWidth;
  scene.height = kFilmHeight;
  scene.background = {0, 0, 0};
  const sim::Volume ct = test::volume_of({90, 40, 60}, 2e-3, sim::Vector3(-0.09, -0.04, -0.06),
                                         [](const sim::Vector3&) { return 100.0; });
  sim::PlanPictures pictures(plan,
                             std::make_shared<const sim::ShadedVolume>(sim::shade(
                                 ct, {sim::Vector3(-0.09, -0.04, -0.06), sim::Vector3(0.09, 0.04, 0.06)})),
                             sim::find_transfer_function("liver"), sim::GpuUse::kOff, scene);
  CompositionForm form;
  form.width = kFilmWidth;
  form.height = kFilmHeight;
  form.arrangement = Arrangement::kOverlay;
  PairedPictures paired(recording, reader_.identities, comparison, frames, pictures, form, 0, 2 * kSecond);
  const auto caption = [&](std::int64_t at_ns) {
    (void)paired.at(at_ns);
    return paired.caption_at(at_ns).step;
  };
  // The picture that is shown counts, not the film's time.
  EXPECT_THAT(caption(kTenthNs + kTenthNs / 2), HasSubstr("organ placed, standard error "));
  EXPECT_THAT(caption(kSmokeFrom * kTenthNs), HasSubstr("organ not found here"));
  EXPECT_THAT(caption(kSecond), HasSubstr("organ placed, standard error "));
  EXPECT_THAT(caption(2 * kSecond - kTenthNs), HasSubstr("organ not looked for here"));
}

TEST(Alignment, OfAnHourMakesADocumentThatIsStillShown) {
  Comparison comparison;
  Alignment& alignment = comparison.alignment.emplace();
  sim::AlignedMoment moment;
  moment.why = sim::WhyLost::kNotLost;
  moment.camera.eye_m = {-0.123456, -0.234567, 0.345678};
  moment.camera.to_view.setConstant(-0.1234567);
  moment.standard_error_m = 1.23e-3;
  moment.misfit_px = moment.rival_px = 12.34;
  for (; moment.time_ns <= kLongestAlignedNs; moment.time_ns += kAlignedEveryNs) {
    alignment.moments.push_back(moment);
    alignment.moments.back().time_ns += 1'000'000'000'000'000;  // a machine that ran for days
  }
  alignment.surface.nodes.assign(kMostDrawnNodes, {-0.12345, -0.12345, -0.12345});
  alignment.surface.faces.assign(2 * kMostDrawnNodes, {9999, 9998, 9997});
  const std::string text = comparison_json(comparison, {}, {});
  EXPECT_LT(text.size(), kLargestDocument);
  EXPECT_LT(text.size(), apps::kLargestSmallFile) << "kiroku compare --verify reads no more";
  EXPECT_NO_THROW((void)read_provenance(text, "an hour"));
}

TEST(Alignment, HasTheLimitsThatTheServerKnows) {
  // The server stands beside a recorder: what aligns has no place in it.
  EXPECT_EQ(viewer::kLeastAlignedFieldDeg, sim::OrganTrack::kLeastFieldDeg);
  EXPECT_EQ(viewer::kGreatestAlignedFieldDeg, sim::OrganTrack::kGreatestFieldDeg);
  EXPECT_EQ(viewer::kLongestAlignedStretchNs, kLongestAlignedNs);
}

TEST(Alignment, OfMoreThanAnHourIsRefused) {
  EXPECT_NO_THROW(require_alignable({5, 5 + kLongestAlignedNs}));
  EXPECT_THROW(require_alignable({5, 6 + kLongestAlignedNs}), UsageError);
}

}  // namespace
}  // namespace kiroku::compare

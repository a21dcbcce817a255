// A recorded operation in which the organ's place is known: the plan is laid on it, and the document and the
// film say where, how well, and where not.
#include "viewer/compare/organ_alignment.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "media/film_writer.h"
#include "sim/mesh/mesh_writer.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/barrel_lens.h"
#include "tests/support/endoscope_scene.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/pulled_organ.h"
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

constexpr int kFilmWidth = 320, kFilmHeight = 240;

/// Over a CT that is the same everywhere.
sim::PlanPictures pictures_of(const sim::Plan& plan) {
  sim::Scene scene;
  scene.width = kFilmWidth;
  scene.height = kFilmHeight;
  scene.background = {0, 0, 0};
  const sim::Vector3 corner(0.09, 0.04, 0.06);
  const sim::Volume ct =
      test::volume_of({90, 40, 60}, 2e-3, -corner, [](const sim::Vector3&) { return 100.0; });
  return {plan, std::make_shared<const sim::ShadedVolume>(sim::shade(ct, {-corner, corner})),
          sim::find_transfer_function("liver"), sim::GpuUse::kOff, scene};
}

CompositionForm overlay() {
  CompositionForm form;
  form.width = kFilmWidth;
  form.height = kFilmHeight;
  form.arrangement = Arrangement::kOverlay;
  return form;
}

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

  /// The organ is held still for two seconds, above or where those say.
  [[nodiscard]] sim::Plan plan(const std::vector<std::size_t>& held = {}) const {
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
    if (!held.empty()) document["fixed"] = {{{"nodes", held}}};
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
  const sim::Plan plan = this->plan();
  const AlignmentRequest request{{0, 2 * kSecond}, EndoscopeScene::kFieldDeg, {}};
  const Alignment found = align_organ(recording, reader_.identities, "endoscope", plan.body, request);
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
  EXPECT_TRUE(told["deformed"].is_null());
  EXPECT_FALSE(told["moments"][0].contains("rigid"));
  EXPECT_EQ(told["surface"]["moved_mm"], 0);
  ASSERT_EQ(told["surface"]["nodes_mm"].size(), 3 * surface_.nodes.size());
  EXPECT_NEAR(told["surface"]["nodes_mm"][5].get<double>(), 1000 * surface_.nodes[1].z(), 0.005);
  ASSERT_EQ(told["surface"]["faces"].size(), 3 * surface_.faces.size());
  EXPECT_EQ(told["surface"]["faces"][4], surface_.faces[1][1]);

  // On the film's pictures. Nobody looked at what is outside of the stretch that was aligned.
  comparison.alignment->moments.resize(kPictures + 2);
  sim::PlanPictures pictures = pictures_of(plan);
  CompositionForm form = overlay();
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

/// How much of what is drawn or expected is both.
double overlap(const std::vector<bool>& drawn, const std::vector<bool>& expected) {
  double both = 0, either = 0;
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    both += drawn[i] && expected[i] ? 1 : 0;
    either += drawn[i] || expected[i] ? 1 : 0;
  }
  return either > 0 ? both / either : 0;
}

TEST_F(OrganAlignment, ThroughALensIsLaidWhereTheRecordedPictureShowsTheOrgan) {
  const test::BarrelLens barrel = test::BarrelLens::of_corners(0.15);
  constexpr int kCount = 4;
  media::FilmWriter writer(folder_ / "barrel.mkv",
                           {EndoscopeScene::kWidth, EndoscopeScene::kHeight, 3, kPictures, 1}, true);
  for (int i = 0; i < kCount; ++i) {
    EndoscopeScene::Look look;
    look.camera = truth(i);
    const sim::Picture picture = barrel.through(scene_.picture(look));
    writer.add({picture.width, picture.height, 3, picture.rgb});
  }
  writer.finish();
  std::ifstream in(folder_ / "barrel.mkv", std::ios::binary);
  const test::RecordedStream film{"endoscope",
                                  "video",
                                  "video/x-matroska",
                                  {to_bytes(std::string{std::istreambuf_iterator<char>(in), {}})},
                                  {kCount}};
  const archive::CaseReader recording =
      archive::CaseReader::open(test::record_case(folder_ / "archive", {film}, reader_.recipients));
  const sim::Plan plan = this->plan();
  const sim::Lens lens(barrel.calibration(EndoscopeScene::kFieldDeg));
  AlignmentRequest request{{0, kSecond}, 0, {}};
  request.lens = UsedLens{lens, {"lens", "endoscope.yml", 3, crypto::sha256(to_bytes(std::string("abc")))}};
  const Alignment found = align_organ(recording, reader_.identities, "endoscope", plan.body, request);
  ASSERT_EQ(found.moments.size(), std::size_t{kCount});
  for (int i = 0; i < kCount; ++i) {
    const sim::AlignedMoment& moment = found.moments[static_cast<std::size_t>(i)];
    ASSERT_TRUE(moment.held()) << i << ": " << sim::name_of(moment.why);
    EXPECT_LT(sim::way_between_m(surface_, moment.camera, truth(i)), 2e-3) << i;
  }

  const sim::PlanFrames frames(plan);
  ByHand by_hand;
  by_hand.steps.emplace().emplace_back().span = {0, kSecond};
  Comparison comparison = compare(recording, reader_.identities, "endoscope", plan, by_hand, {});
  comparison.alignment = found;
  const auto told = nlohmann::json::parse(comparison_json(comparison, plan, {}))["organ_alignment"];
  EXPECT_EQ(told["field_deg"], lens.field_deg());
  EXPECT_EQ(told["lens"]["file"]["name"], "endoscope.yml");
  EXPECT_THAT(told["lens"]["file"]["sha256"].get<std::string>(), HasSubstr("ba7816bf"));
  EXPECT_EQ(told["lens"]["model"], "brown");
  EXPECT_EQ(told["lens"]["width"], 640);
  // To the bit: whoever repeats it has the same lens.
  EXPECT_EQ(told["lens"]["focal_px"][1], lens.calibration().focal_px.y());
  EXPECT_EQ(told["lens"]["middle_px"][0], lens.calibration().middle_px.x());
  EXPECT_EQ(told["lens"]["coefficients"], nlohmann::json(lens.calibration().coefficients));
  EXPECT_EQ(told["lens"]["reach"], lens.reach());

  // What the film draws of the organ, whose displacements are nothing and are all told.
  const sim::Pinhole pinhole =
      sim::pinhole_of(EndoscopeScene::kFieldDeg, EndoscopeScene::kWidth, EndoscopeScene::kHeight);
  const auto organ =
      sim::silhouette_of(surface_, truth(0), pinhole, EndoscopeScene::kWidth, EndoscopeScene::kHeight, 1);
  ASSERT_TRUE(organ);
  std::vector<bool> expected, unbent;
  const auto covers = [&](const Eigen::Vector2d& at) {
    const auto x = std::lround(at.x()), y = std::lround(at.y());
    return x >= 0 && y >= 0 && x < organ->width && y < organ->height &&
           organ->at(static_cast<int>(x), static_cast<int>(y)) > 0;
  };
  for (int y = 0; y < kFilmHeight; ++y) {
    for (int x = 0; x < kFilmWidth; ++x) {
      const Eigen::Vector2d pixel(2 * x + 0.5, 2 * y + 0.5);
      expected.push_back(covers(barrel.straight(pixel)));
      unbent.push_back(covers(pixel));
    }
  }
  sim::PlanPictures pictures = pictures_of(plan);
  CompositionForm form = overlay();
  form.plan_background = pictures.scene().background;
  const auto drawn_by = [&] {
    const auto with_share = [&](double share) {
      form.share = share;
      PairedPictures paired(recording, reader_.identities, comparison, frames, pictures, form, 0, kSecond);
      return paired.at(0);
    };
    const sim::Picture without = with_share(0), with = with_share(1);
    const int top = (with.height - kFilmHeight) / 3;  // a line of words above, two below
    std::vector<bool> drawn;
    for (int y = 0; y < kFilmHeight; ++y) {
      for (int x = 0; x < kFilmWidth; ++x) {
        drawn.push_back(
            !std::equal(with.pixel(x, y + top), with.pixel(x, y + top) + 3, without.pixel(x, y + top)));
      }
    }
    return drawn;
  };
  const std::vector<bool> rigid = drawn_by();
  EXPECT_GT(overlap(rigid, expected), 0.95);
  EXPECT_LT(overlap(rigid, unbent), 0.9) << "a lens that bends nothing would tell nothing";

  comparison.alignment->deformed.emplace(found.surface.nodes.size());
  for (const sim::AlignedMoment& moment : found.moments) {
    Deformation& shape = comparison.alignment->deformed->moments.emplace_back();
    shape.why = sim::WhyRigid::kDeformed;
    shape.camera = moment.camera;
    shape.told.assign(found.surface.nodes.size(), true);
  }
  const std::vector<bool> deformed = drawn_by();
  EXPECT_GT(overlap(deformed, expected), 0.95);
  EXPECT_LT(overlap(deformed, unbent), 0.9);

  // Pictures of another shape are none of this lens.
  sim::LensCalibration wide = lens.calibration();
  wide.height = 360;
  wide.middle_px.y() = 179.5;
  request.lens = UsedLens{sim::Lens(wide), {}};
  EXPECT_THROW((void)align_organ(recording, reader_.identities, "endoscope", plan.body, request), UsageError);
}

/// The organ is at rest, then a spot of it is pulled, and stays pulled.
class PulledOrganAlignment : public OrganAlignment {
 protected:
  static constexpr int kCount = 8, kRests = 3;

  [[nodiscard]] archive::CaseReader record_pulled() {
    const test::PulledOrgan truth({22, 7, 16});
    EndoscopeScene scene(truth.mesh());
    const Eigen::VectorXd force = truth.force_n({0.05, -0.01, -0.01}, {0.3, -0.2, -1}, 0.02);
    media::FilmWriter writer(folder_ / "pulled.mkv",
                             {EndoscopeScene::kWidth, EndoscopeScene::kHeight, 3, kPictures, 1}, true);
    for (int i = 0; i < kCount; ++i) {
      EndoscopeScene::Look look;
      look.camera = this->truth(0);
      look.seed = static_cast<std::uint32_t>(i + 1);
      const Eigen::VectorXd gone = truth.displacement_m(std::clamp((i - kRests + 1) / 6.0, 0.0, 0.5) * force);
      look.displacement_m.assign(gone.data(), gone.data() + gone.size());
      const sim::Picture picture = scene.picture(look);
      writer.add({picture.width, picture.height, 3, picture.rgb});
    }
    writer.finish();
    std::ifstream in(folder_ / "pulled.mkv", std::ios::binary);
    const test::RecordedStream film{"endoscope",
                                    "video",
                                    "video/x-matroska",
                                    {to_bytes(std::string{std::istreambuf_iterator<char>(in), {}})},
                                    {kCount}};
    return archive::CaseReader::open(test::record_case(folder_ / "archive", {film}, reader_.recipients));
  }
};

TEST_F(PulledOrganAlignment, IsDeformedInDocumentAndFilm) {
  const archive::CaseReader recording = record_pulled();
  std::vector<std::size_t> held;
  for (std::size_t node = 0; node < mesh_.nodes.size(); ++node) {
    if ((mesh_.nodes[node] - test::Held{}.middle_m).norm() < test::Held{}.radius_m) held.push_back(node);
  }
  const sim::Plan plan = this->plan(held);
  AlignmentRequest request{{0, kSecond}, EndoscopeScene::kFieldDeg, {}};
  request.deformed = true;
  std::vector<double> shares;
  const Alignment found = align_organ(recording, reader_.identities, "endoscope", plan.body, request,
                                      [&](double share) { shares.push_back(share); });
  EXPECT_EQ(shares.size(), std::size_t{kCount});
  ASSERT_TRUE(found.deformed);
  ASSERT_EQ(found.deformed->moments.size(), std::size_t{kCount});
  EXPECT_EQ(found.deformed->moments[0].why, sim::WhyRigid::kAtRest);
  EXPECT_FALSE(found.deformed->moments[1].deformed());
  const Deformation& last = found.deformed->moments.back();
  ASSERT_TRUE(last.deformed()) << sim::name_of(last.why) << ", " << sim::name_of(last.unfitted);
  EXPECT_GT(last.largest_m, 0.005);
  EXPECT_LT(last.standard_error_m, sim::DeformedFit::kLargestErrorM);
  ASSERT_TRUE(found.deformed->moments[kCount - 2].deformed());
  const auto between = found.deformed_at((kCount - 2) * kTenthNs + kTenthNs / 2);
  ASSERT_TRUE(between);
  EXPECT_GE(between->standard_error_m, last.standard_error_m);
  EXPECT_FALSE(found.deformed_at(kTenthNs));
  EXPECT_EQ(found.rigid_at(kTenthNs), found.deformed->moments[1].why);
  EXPECT_FALSE(found.rigid_at((kCount - 1) * kTenthNs));

  const sim::PlanFrames frames(plan);
  ByHand by_hand;
  by_hand.steps.emplace().emplace_back().span = {0, kSecond};
  Comparison comparison = compare(recording, reader_.identities, "endoscope", plan, by_hand, {});
  comparison.alignment = found;
  const auto told = nlohmann::json::parse(comparison_json(comparison, plan, {}))["organ_alignment"];
  EXPECT_EQ(told["deformed"]["pictures"], found.deformed->deformed());
  EXPECT_EQ(told["moments"][0]["rigid"], "at-rest");
  // Whoever reads the document comes to the same displacements.
  const auto& written = told["moments"].back()["deformed"];
  EXPECT_EQ(written["since_ns"], 0);
  const auto shown = found.deformed_at((kCount - 1) * kTenthNs);
  ASSERT_TRUE(shown);
  for (std::size_t node = 0; node < shown->displacement_m.size(); node += 17) {
    sim::Vector3 sum_mm = sim::Vector3::Zero();
    for (std::size_t i = 0; i < written["weights_mm"].size(); ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        sum_mm[axis] +=
            written["weights_mm"][i].get<double>() *
            told["deformed"]["fields"][i][3 * node + static_cast<std::size_t>(axis)].get<double>();
      }
    }
    ASSERT_LT((sum_mm - 1000 * shown->displacement_m[node]).norm(), 1e-6) << node;
  }

  sim::PlanPictures pictures = pictures_of(plan);
  CompositionForm form = overlay();
  form.share = 1;
  PairedPictures paired(recording, reader_.identities, comparison, frames, pictures, form, 0, kSecond);
  (void)paired.at(kTenthNs);
  EXPECT_THAT(paired.caption_at(kTenthNs).step, HasSubstr("rigid organ, error "));
  EXPECT_EQ(paired.caption_at(kTenthNs).displacement_mm, 0);
  const sim::Picture film = paired.at((kCount - 1) * kTenthNs);
  const Caption caption = paired.caption_at((kCount - 1) * kTenthNs);
  EXPECT_THAT(caption.step, HasSubstr("organ deformed up to "));
  EXPECT_EQ(caption.displacement_mm, found.deformed->scale_mm());
  // Viridis is nowhere as red as tissue: what is held is violet, what is pulled green or yellow.
  int violet = 0, green = 0;
  for (int y = 0; y < film.height; ++y) {
    for (int x = 0; x < film.width; ++x) {
      const std::uint8_t* const pixel = film.pixel(x, y);
      violet += pixel[2] > pixel[0] && pixel[2] > pixel[1] + 40 ? 1 : 0;
      green += pixel[1] > pixel[0] + 40 && pixel[1] > pixel[2] ? 1 : 0;
    }
  }
  EXPECT_GT(violet, 1000);
  EXPECT_GT(green, 100);
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
  EXPECT_LT(text.size(), kLargestDocument) << "kiroku compare --verify and the viewer read no more";
  EXPECT_NO_THROW((void)read_provenance(text, "an hour"));
}

TEST(Alignment, OfTenMinutesOfTheMostVariousDeformationsMakesADocumentThatIsStillShown) {
  Comparison comparison;
  Alignment& alignment = comparison.alignment.emplace();
  DeformedAlignment& deformed = alignment.deformed.emplace(kMostDeformedNodes);
  // Fields that no other ones make up: a node more goes aside in each.
  std::vector<sim::Vector3> displacement_m(kMostDeformedNodes, sim::Vector3(-0.0123, -0.0234, -0.0345));
  for (std::size_t i = 0; i < DisplacementFields::kMostFields; ++i) {
    displacement_m[i].x() = 0.0123;
    ASSERT_TRUE(deformed.fields.take(displacement_m)) << i;
  }
  ASSERT_EQ(deformed.fields.fields().size(), DisplacementFields::kMostFields);
  sim::AlignedMoment moment;
  moment.why = sim::WhyLost::kNotLost;
  moment.camera.eye_m = {-0.123456, -0.234567, 0.345678};
  moment.camera.to_view.setConstant(-0.1234567);
  moment.standard_error_m = 1.23e-3;
  moment.misfit_px = moment.rival_px = 12.34;
  Deformation shape;
  shape.why = sim::WhyRigid::kDeformed;
  shape.rest_ns = 1'000'000'000'000'000;
  shape.camera = moment.camera;
  shape.weights_mm.assign(DisplacementFields::kMostFields, -12.34);
  shape.told.assign(kMostDeformedNodes, false);
  shape.standard_error_m = shape.largest_m = 0.01234;
  shape.misfit_px = 12.34;
  Departure departure;
  departure.why = WhyNoDeparture::kCompared;
  departure.moment = PlanMoment{9, 123.456, false};
  departure.beyond_m.assign(kMostDeformedNodes, 0.01234F);
  departure.told = departure.beyond = 0.123;
  departure.standard_error_m = departure.largest_m = departure.largest_error_m = 0.01234;
  for (; moment.time_ns <= kLongestDeformedNs; moment.time_ns += kAlignedEveryNs) {
    alignment.moments.push_back(moment);
    alignment.moments.back().time_ns += 1'000'000'000'000'000;
    deformed.moments.push_back(shape);
    deformed.departures.push_back(departure);
  }
  alignment.surface.nodes.assign(kMostDeformedNodes, {-0.12345, -0.12345, -0.12345});
  alignment.surface.faces.assign(2 * kMostDeformedNodes, {1999, 1998, 1997});
  const std::string text = comparison_json(comparison, {}, {});
  EXPECT_LT(text.size(), kLargestDocument);
  EXPECT_NO_THROW((void)read_provenance(text, "ten minutes"));
}

// A pulled organ's departures drawn on one that is shown at rest would be of no picture.
TEST(Alignment, SaysOfAnOrganAtRestNoDepartureOfADeformedOne) {
  constexpr std::size_t kNodes = 4;
  struct Looked {
    std::optional<std::int64_t> since;  // deformed since then; else at rest
    bool held = true;
  };
  const auto alignment_of = [&](const Looked& first, const Looked& second) {
    Alignment alignment;
    DeformedAlignment& deformed = alignment.deformed.emplace(kNodes);
    alignment.surface.nodes.assign(kNodes, sim::Vector3::Zero());
    for (const Looked& each : {first, second}) {
      sim::AlignedMoment moment;
      moment.time_ns = std::int64_t(alignment.moments.size()) * kAlignedEveryNs;
      moment.why = each.held ? sim::WhyLost::kNotLost : sim::WhyLost::kNoOrgan;
      alignment.moments.push_back(moment);
      Deformation shape;
      shape.why = each.since ? sim::WhyRigid::kDeformed : sim::WhyRigid::kWithinError;
      shape.rest_ns = each.since.value_or(0);
      shape.told.assign(kNodes, true);
      deformed.moments.push_back(shape);
      deformed.departures.emplace_back();
    }
    return alignment;
  };
  // Which moment's departure is said between the two; -1: none.
  const auto said = [&](const Looked& first, const Looked& second) {
    const Alignment alignment = alignment_of(first, second);
    const Departure* departure = alignment.departure_at(kAlignedEveryNs / 2);
    return departure == nullptr ? -1 : departure - alignment.deformed->departures.data();
  };
  EXPECT_EQ(said({0}, {0}), 0);
  EXPECT_EQ(said({}, {}), 0);
  EXPECT_EQ(said({}, {0}), 0);
  EXPECT_EQ(said({0}, {}), 1) << "it is shown at rest, as it is in the second";
  EXPECT_EQ(said({0}, {kAlignedEveryNs}), -1) << "nothing connects the two shapes";
  EXPECT_EQ(said({0}, {.since = {}, .held = false}), 0) << "it is not shown";
  const Alignment alignment = alignment_of({0}, {});
  EXPECT_EQ(alignment.departure_at(0), &alignment.deformed->departures[0]);
  EXPECT_EQ(alignment.departure_at(kAlignedEveryNs), &alignment.deformed->departures[1]);
}

TEST(DisplacementFields, GiveBackWhatTheyTookWithinTheirStatedError) {
  constexpr std::size_t kNodes = 50;
  DisplacementFields fields(kNodes);
  for (int i = 0; i < 40; ++i) {
    std::vector<sim::Vector3> wanted_m;
    for (std::size_t node = 0; node < kNodes; ++node) {
      const double at = double(node) / kNodes, grows = 0.001 * i;
      wanted_m.emplace_back(grows * at, grows * at * at * std::cos(0.1 * i), grows * std::sin(3 * at));
    }
    const auto weights = fields.take(wanted_m);
    ASSERT_TRUE(weights) << i;
    const std::vector<sim::Vector3> sum_m = fields.sum(*weights);
    for (std::size_t node = 0; node < kNodes; ++node)
      ASSERT_LE(1000 * (sum_m[node] - wanted_m[node]).norm(), DisplacementFields::kMostErrorMm) << node;
  }
  // The three kinds of displacement that there are, and what rounding asks for.
  EXPECT_LE(fields.fields().size(), 6U);
}

TEST(DisplacementFields, TakeNoMoreThanADocumentHasRoomFor) {
  constexpr std::size_t kNodes = 2 * DisplacementFields::kMostFields;
  DisplacementFields fields(kNodes);
  std::vector<sim::Vector3> wanted_m(kNodes, sim::Vector3::Zero());
  for (std::size_t i = 0; i < DisplacementFields::kMostFields; ++i) {
    wanted_m.assign(kNodes, sim::Vector3::Zero());
    wanted_m[i].x() = 0.01;
    ASSERT_TRUE(fields.take(wanted_m)) << i;
  }
  wanted_m.assign(kNodes, sim::Vector3::Zero());
  wanted_m.back().x() = 0.01;
  EXPECT_FALSE(fields.take(wanted_m));
  wanted_m.assign(kNodes, sim::Vector3::Zero());
  wanted_m[3].x() = 0.02;
  EXPECT_TRUE(fields.take(wanted_m)) << "those that are there still serve";
}

TEST(Alignment, HasTheLimitsThatTheServerKnows) {
  // The server stands beside a recorder: what aligns has no place in it.
  EXPECT_EQ(viewer::kLeastAlignedFieldDeg, sim::OrganTrack::kLeastFieldDeg);
  EXPECT_EQ(viewer::kGreatestAlignedFieldDeg, sim::OrganTrack::kGreatestFieldDeg);
  EXPECT_EQ(viewer::kLongestAlignedStretchNs, kLongestAlignedNs);
  EXPECT_EQ(viewer::kLongestDeformedStretchNs, kLongestDeformedNs);
}

TEST(Alignment, OfMoreThanAnHourIsRefused) {
  EXPECT_NO_THROW(require_alignable({5, 5 + kLongestAlignedNs}, false));
  EXPECT_THROW(require_alignable({5, 6 + kLongestAlignedNs}, false), UsageError);
  EXPECT_NO_THROW(require_alignable({5, 5 + kLongestDeformedNs}, true));
  EXPECT_THROW(require_alignable({5, 6 + kLongestDeformedNs}, true), UsageError);
}

}  // namespace
}  // namespace kiroku::compare

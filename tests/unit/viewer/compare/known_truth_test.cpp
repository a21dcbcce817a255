// A replay of a plan that is recorded as if it were the endoscope's, with its steps in another order, slower
// and with pauses: everything that a comparison should find is known.
#include <cmath>
#include <fstream>
#include <iterator>
#include <random>

#include <nlohmann/json.hpp>

#include "media/film_writer.h"
#include "sim/mesh/mesh_writer.h"
#include "sim/render/plan_pictures.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/recorded_case.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tet_grid.h"
#include "viewer/compare/comparison.h"
#include "viewer/compare/paired_pictures.h"

namespace kiroku::compare {
namespace {

constexpr int kTruthWidth = 320, kTruthHeight = 240, kTruthRate = 25;

/// Steps of the plan: one finger presses (2 s), nothing moves (1 s), another finger glides (2 s). Done: the
/// glide first and twice as slow, 1.2 s of pause, the press, interrupted in its middle for 0.8 s, the hold
/// half as long.
struct Done {
  std::size_t step = 0;
  double start_s = 0, end_s = 0;
  double pause_from_s = 0, pause_to_s = 0;
};
const std::vector<Done> kDone{{2, 0.6, 4.6, 0, 0}, {0, 5.8, 8.6, 6.8, 7.6}, {1, 8.6, 9.1, 0, 0}};
constexpr double kRecordedS = 10;
const std::vector<PlannedStep> kPlanned{{"press first", 0, 2}, {"hold", 2, 1}, {"glide", 3, 2}};

/// Where the plan is at a moment of the recording.
PlanMoment truth_at(double case_s) {
  PlanMoment moment{kDone.front().step, kPlanned[kDone.front().step].start_s, true};
  for (const Done& done : kDone) {
    const PlannedStep& planned = kPlanned[done.step];
    if (case_s < done.start_s) break;
    const double pause_s = done.pause_to_s - done.pause_from_s;
    double active_s = std::min(case_s, done.end_s) - done.start_s;
    if (pause_s > 0 && case_s > done.pause_from_s)
      active_s -= std::min(case_s, done.pause_to_s) - done.pause_from_s;
    const double share = active_s / (done.end_s - done.start_s - pause_s);
    const bool paused = pause_s > 0 && case_s >= done.pause_from_s && case_s < done.pause_to_s;
    moment = {done.step, planned.start_s + share * planned.duration_s, paused || case_s >= done.end_s};
  }
  return moment;
}

class KnownTruth : public testing::Test {
 protected:
  KnownTruth() {
    // A slab of tissue of 80 x 60 x 24 mm, its back fixed, in a CT with spots of some millimetres.
    sim::TetMesh mesh = test::tet_grid({10, 4, 8}, {0.08, 0.024, 0.06});
    std::ofstream(folder_ / "slab.msh") << sim::msh_text(mesh, sim::LengthUnit::kMillimetre);
    const sim::Volume ct =
        test::volume_of({90, 34, 70}, 1e-3, sim::Vector3::Constant(-0.005), [](const sim::Vector3& at) {
          const sim::Vector3 mm = at * 1000;
          return 60 + 60 * std::sin(0.9 * mm.x() + std::sin(0.5 * mm.z())) *
                          std::cos(0.8 * mm.z() + std::sin(0.4 * mm.x()));
        });
    volume_ = std::make_shared<const sim::ShadedVolume>(
        sim::shade(ct, {sim::Vector3::Constant(-0.005), sim::Vector3(0.085, 0.029, 0.065)}));
    camera_ = sim::camera_looking_at({{0.04, 0.012, 0.03}, 0.05}, {20, 15}, kTruthWidth, kTruthHeight);
    plan_ = plan_with(0);
    frames_.emplace(*plan_);
  }

  /// The same plan with the gliding finger so far off its way.
  [[nodiscard]] sim::Plan plan_with(double aside_mm) const {
    const auto at = [](double x, double y, double z) { return nlohmann::json{x, y, z}; };
    nlohmann::json document{
        {"name", "slab"},
        {"mesh", "slab.msh"},
        {"length_unit", "mm"},
        {"time_step_s", 0.04},
        {"materials", {{{"region", "all"}, {"young_modulus_pa", 8000}, {"poisson_ratio", 0.4}}}},
        {"fixed", {{{"box", {at(0, 24, 0), at(80, 24, 60)}}}}},
        {"tools",
         {{"first", {{"kind", "finger"}, {"radius", 7}}}, {"second", {{"kind", "finger"}, {"radius", 7}}}}}};
    document["steps"] = {
        {{"do", "press"},
         {"name", "press first"},
         {"tool", "first"},
         {"path",
          {{{"at_s", 0}, {"position", at(20, -7.5, 15)}}, {{"at_s", 2}, {"position", at(24, -3, 18)}}}}},
        {{"do", "hold"}, {"name", "hold"}, {"duration_s", 1}},
        {{"do", "press"},
         {"name", "glide"},
         {"tool", "second"},
         {"path",
          {{{"at_s", 0}, {"position", at(50, -6, 40)}},
           {{"at_s", 2}, {"position", at(66, -6, 22 + aside_mm)}}}}}};
    std::ofstream(folder_ / "plan.json") << document;
    sim::PlanReading reading = sim::read_plan(folder_ / "plan.json");
    EXPECT_THAT(reading.errors, testing::IsEmpty());
    return *reading.plan;
  }

  /// Records what `frames` of `plan` look like at the truth's moments, a lossless segment a second.
  std::filesystem::path record(const sim::Plan& plan, const sim::PlanFrames& frames,
                               const std::vector<Mark>& marks) {
    sim::Scene scene;
    scene.camera = camera_;
    scene.width = kTruthWidth;
    scene.height = kTruthHeight;
    sim::PlanPictures pictures(plan, volume_, sim::find_transfer_function("liver"), sim::GpuUse::kOff, scene);
    test::RecordedStream film{"endoscope", "video", "video/x-matroska", {}, {}};
    const sim::PlanFrames::Kept* shown = nullptr;
    sim::Picture picture;
    for (int second = 0; second < int(kRecordedS); ++second) {
      media::FilmWriter writer(folder_ / "second.mkv", {kTruthWidth, kTruthHeight, 3, kTruthRate, 1}, true);
      for (int i = 0; i < kTruthRate; ++i) {
        const PlanMoment moment = truth_at(second + double(i) / kTruthRate);
        const sim::PlanFrames::Kept& kept = frames.at(moment.step, moment.plan_s);
        if (&kept != shown) picture = pictures.picture(kept.frame, *kept.mesh);
        shown = &kept;
        writer.add({kTruthWidth, kTruthHeight, 3, picture.rgb});
      }
      writer.finish();
      std::ifstream in(folder_ / "second.mkv", std::ios::binary);
      film.segments.push_back(to_bytes(std::string{std::istreambuf_iterator<char>(in), {}}));
      film.units.push_back(kTruthRate);
    }
    std::string lines;
    for (const Mark& mark : marks) {
      const nlohmann::json event{{"time_ns", mark.time_ns}, {"kind", "mark"}, {"text", mark.text}};
      lines += nlohmann::json{{"salt", std::string(64, '0')}, {"event", event.dump()}}.dump() + "\n";
    }
    const test::RecordedStream events{
        "events", "events", "application/jsonl", {to_bytes(lines)}, {marks.size()}};
    return test::record_case(folder_ / "archive", {film, events}, reader_.recipients);
  }

  /// What a person would mark, so late.
  static std::vector<Mark> marks(const std::function<double()>& late_s) {
    std::vector<Mark> all;
    const auto add = [&](double at_s, const std::string& text) {
      all.push_back({std::llround((at_s + late_s()) * 1e9), text});
    };
    for (const Done& done : kDone) {
      add(done.start_s, kPlanned[done.step].name);
      if (done.pause_to_s > 0) {
        add(done.pause_from_s, "pause");
        add(done.pause_to_s, "resume");
      }
      add(done.end_s, kPlanned[done.step].name + " done");
    }
    return all;
  }

  /// Corners and the middle of the slab's front, clicked half a pixel off; the second tool, clicked each
  /// second.
  [[nodiscard]] ByHand by_hand(const sim::PlanFrames& recorded) const {
    std::mt19937 random(7);
    const auto click = [&](const sim::Vector3& at) {
      const double x = double(random()) / 4294967296.0 - 0.5, y = double(random()) / 4294967296.0 - 0.5;
      return Eigen::Vector2d(*pixel_of(camera_, at, kTruthWidth, kTruthHeight) + Eigen::Vector2d(x, y));
    };
    ByHand said;
    said.registration.emplace();
    said.registration->time_ns = kSecond / 5;
    const double half = camera_.half_extent.minCoeff();
    said.registration->field_deg = 2 * std::atan(half) * 180 / 3.14159265358979323846;
    for (const sim::Vector3& at :
         {sim::Vector3(0, 0, 0), sim::Vector3(0.08, 0, 0), sim::Vector3(0.08, 0, 0.06),
          sim::Vector3(0, 0, 0.06), sim::Vector3(0.08, 0.024, 0.06), sim::Vector3(0.08, 0.024, 0),
          sim::Vector3(0, 0.0, 0.03)})
      said.registration->points.push_back({at, click(at)});
    for (const double at_s : {0.6, 1.1, 1.6, 2.1, 2.6, 3.1, 3.6, 4.1, 4.56}) {
      const auto tip = tool_at(recorded, 1, truth_at(at_s));
      said.tools[1].push_back(
          {std::llround(at_s * 1e9), *pixel_of(camera_, *tip, kTruthWidth, kTruthHeight)});
    }
    return said;
  }

  test::TemporaryFolder folder_;
  test::Reader reader_ = test::make_reader();
  std::shared_ptr<const sim::ShadedVolume> volume_;
  sim::Camera camera_;
  std::optional<sim::Plan> plan_;
  std::optional<sim::PlanFrames> frames_;
};

TEST_F(KnownTruth, StepsAreFoundWithinAFifthOfASecondByMarksThatCameLate) {
  std::mt19937 random(5);
  const auto late_s = [&] { return 0.18 * double(random()) / 4294967296.0; };
  const auto folder = record(*plan_, *frames_, marks(late_s));
  const auto recording = archive::CaseReader::open(folder);
  const Comparison found = compare(recording, reader_.identities, "endoscope", *plan_, {}, {});
  ASSERT_EQ(found.matching.matches.size(), kDone.size());
  EXPECT_FALSE(found.matching.in_planned_order());
  EXPECT_FALSE(found.map->monotone());
  for (std::size_t i = 0; i < kDone.size(); ++i) {
    const StepMatch& match = found.matching.matches[i];
    EXPECT_EQ(match.step, kDone[i].step);
    EXPECT_NEAR(double(match.span.start_ns), kDone[i].start_s * 1e9, 0.2e9) << i;
    EXPECT_NEAR(double(match.span.end_ns), kDone[i].end_s * 1e9, 0.2e9) << i;
    ASSERT_EQ(match.pauses.size(), kDone[i].pause_to_s > 0 ? 1U : 0U);
    for (const archive::Span& pause : match.pauses) {
      EXPECT_NEAR(double(pause.start_ns), kDone[i].pause_from_s * 1e9, 0.2e9);
      EXPECT_NEAR(double(pause.end_ns), kDone[i].pause_to_s * 1e9, 0.2e9);
    }
  }
  EXPECT_NEAR(double(*found.figures[0].pause_before_ns), 1.2e9, 0.2e9);
  EXPECT_NEAR(double(found.figures[0].pauses_within_ns), 0.8e9, 0.2e9);
}

TEST_F(KnownTruth, AToolThatWentAsPlannedIsWithinAPixelOfItsWay) {
  const auto recording = archive::CaseReader::open(record(*plan_, *frames_, marks([] { return 0.0; })));
  const Comparison found = compare(recording, reader_.identities, "endoscope", *plan_, by_hand(*frames_),
                                   [&]() -> const sim::PlanFrames& { return *frames_; });
  ASSERT_TRUE(found.camera.has_value());
  EXPECT_LT(found.camera->registration().rms_px, 1);
  ASSERT_EQ(found.tools.size(), 1U);
  const ToolDistance& tool = found.tools[0];
  EXPECT_GE(tool.all.pictures, 90U);
  EXPECT_LT(tool.all.largest_px, 1);
  EXPECT_LT(tool.all.mean_px, 1);
  EXPECT_EQ(tool.of_steps[2].pictures, tool.all.pictures);
  RecordProperty("mean_px", std::to_string(tool.all.mean_px));
  RecordProperty("largest_px", std::to_string(tool.all.largest_px));
}

TEST_F(KnownTruth, HowFarAToolWentAsideIsFoundWithinAPixel) {
  // Recorded: a glide that ends 5 mm off. Compared with the plan as it was.
  const sim::Plan aside = plan_with(5);
  const sim::PlanFrames recorded(aside);
  const auto recording = archive::CaseReader::open(record(aside, recorded, marks([] { return 0.0; })));
  const Comparison found = compare(recording, reader_.identities, "endoscope", *plan_, by_hand(recorded),
                                   [&]() -> const sim::PlanFrames& { return *frames_; });
  Distance truth;
  for (double at_s = kDone[0].start_s; at_s < kDone[0].end_s; at_s += 1.0 / kTruthRate) {
    const PlanMoment moment = truth_at(at_s);
    const auto done = pixel_of(camera_, *tool_at(recorded, 1, moment), kTruthWidth, kTruthHeight);
    const auto planned = pixel_of(camera_, *tool_at(*frames_, 1, moment), kTruthWidth, kTruthHeight);
    truth.add((*done - *planned).norm());
  }
  ASSERT_EQ(found.tools.size(), 1U);
  EXPECT_GT(truth.largest_px, 5);
  EXPECT_NEAR(found.tools[0].all.mean_px, truth.mean_px, 1);
  EXPECT_NEAR(found.tools[0].all.largest_px, truth.largest_px, 1);
}

TEST_F(KnownTruth, BothPicturesOfAMomentAreTheSame) {
  const auto recording = archive::CaseReader::open(record(*plan_, *frames_, marks([] { return 0.0; })));
  const Comparison found = compare(recording, reader_.identities, "endoscope", *plan_, {}, {});
  const PictureSize size = picture_size(recording, reader_.identities, "endoscope", 0, 640);
  EXPECT_EQ(size.width, kTruthWidth);
  EXPECT_EQ(size.height, kTruthHeight);
  sim::Scene scene;
  scene.camera = camera_;
  scene.width = kTruthWidth;
  scene.height = kTruthHeight;
  sim::PlanPictures plan(*plan_, volume_, sim::find_transfer_function("liver"), sim::GpuUse::kOff, scene);
  CompositionForm form;
  form.width = kTruthWidth;
  form.height = kTruthHeight;
  PairedPictures paired(recording, reader_.identities, found, *frames_, plan, form, 0, 10 * kSecond);
  ASSERT_EQ(paired.width(), 2 * kTruthWidth + 8);
  // In the middle of each of the plan's time steps, so that rounding decides nothing.
  for (const double at_s : {0.3, 1.02, 3.1, 5.0, 6.5, 7.2, 8.3, 8.8, 9.9}) {
    const sim::Picture both = paired.at(std::llround(at_s * 1e9));
    const int top = (paired.height() - kTruthHeight) / 3;
    double sum = 0;
    for (int y = 0; y < kTruthHeight; ++y) {
      for (int x = 0; x < kTruthWidth; ++x)
        sum += std::abs(int(both.pixel(x, top + y)[0]) - int(both.pixel(kTruthWidth + 8 + x, top + y)[0]));
    }
    EXPECT_LT(sum / (kTruthWidth * kTruthHeight), 0.5) << at_s;
  }
  EXPECT_EQ(paired.caption_at(std::llround(5.0e9)).step, "pause");
  EXPECT_THAT(paired.caption_at(std::llround(5.0e9)).recording, testing::HasSubstr("not verified"));
  EXPECT_EQ(paired.caption_at(std::llround(6.5e9)).step, "step 1 of 3: press first");
}

}  // namespace
}  // namespace kiroku::compare

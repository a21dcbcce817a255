// Where a recorded operation departs from its plan: pictures are rendered of what the plan does, and of what
// it does not.
#include "viewer/compare/departure.h"

#include <algorithm>
#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "media/film_writer.h"
#include "sim/mesh/mesh_writer.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/endoscope_scene.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/pulled_organ.h"
#include "tests/support/recorded_case.h"
#include "tests/support/temporary_folder.h"
#include "viewer/compare/comparison_document.h"
#include "viewer/compare/paired_pictures.h"

namespace kiroku::compare::departures {
namespace {

using test::EndoscopeScene;
using testing::HasSubstr;

constexpr int kPictures = 10;  // a second
constexpr std::int64_t kTenthNs = kSecond / kPictures;
/// The plan waits, presses the left lobe up from below, and holds it.
constexpr double kWaitsS = 0.4, kPressesS = 0.6, kHoldsS = 0.4;
constexpr int kCount = 14;

class DepartureFromPlan : public testing::Test {
 protected:
  /// The finger presses from below there, so far up.
  void plan(double press_x_m, double press_mm) {
    std::ofstream(folder_ / "liver.msh") << sim::msh_text(mesh_, sim::LengthUnit::kMillimetre);
    std::vector<std::size_t> held;
    for (std::size_t node = 0; node < mesh_.nodes.size(); ++node) {
      if ((mesh_.nodes[node] - test::Held{}.middle_m).norm() < test::Held{}.radius_m) held.push_back(node);
    }
    const sim::Vector3 below_mm = 1000 * below_m({press_x_m, 0, 0});
    constexpr double kRadiusMm = 20;
    const auto at = [&](double up_mm) {
      return nlohmann::json{below_mm.x(), below_mm.y(), below_mm.z() - kRadiusMm - 1 + up_mm};
    };
    nlohmann::json document{
        {"name", "liver"},
        {"mesh", "liver.msh"},
        {"length_unit", "mm"},
        {"time_step_s", 0.1},
        {"materials", {{{"region", "all"}, {"young_modulus_pa", 5000}, {"poisson_ratio", 0.4}}}},
        {"fixed", {{{"nodes", held}}}},
        {"tools", {{"finger", {{"kind", "finger"}, {"radius", kRadiusMm}}}}}};
    document["steps"] = {
        {{"do", "hold"}, {"name", "Wait"}, {"duration_s", kWaitsS}},
        {{"do", "press"},
         {"name", "Lift"},
         {"tool", "finger"},
         {"path", {{{"at_s", 0}, {"position", at(0)}}, {{"at_s", kPressesS}, {"position", at(press_mm)}}}}},
        {{"do", "hold"}, {"name", "Hold"}, {"duration_s", kHoldsS}}};
    std::ofstream(folder_ / "plan.json") << document;
    sim::PlanReading reading = sim::read_plan(folder_ / "plan.json");
    EXPECT_THAT(reading.errors, testing::IsEmpty());
    plan_ = *reading.plan;
    frames_.emplace(plan_);
  }

  /// The lowest node near that place, seen from the front.
  [[nodiscard]] sim::Vector3 below_m(const sim::Vector3& near_m) const {
    sim::Vector3 lowest(0, 0, 1);
    for (const sim::Vector3& node : surface_.nodes) {
      if (std::abs(node.x() - near_m.x()) < 0.008 && node.z() < lowest.z()) lowest = node;
    }
    return lowest;
  }

  /// What the organ does in the recording: what is planned, and more where `more_m` says that (3 |V|, how
  /// much of it comes with the pictures).
  [[nodiscard]] archive::CaseReader record(const Eigen::VectorXd& more_m = {}, bool planned = true) {
    EndoscopeScene scene(mesh_);
    media::FilmWriter writer(folder_ / "seen.mkv",
                             {EndoscopeScene::kWidth, EndoscopeScene::kHeight, 3, kPictures, 1}, true);
    for (int i = 0; i < kCount; ++i) {
      EndoscopeScene::Look look;
      look.camera = scene.camera(8, -18, 0.16, 5);
      look.seed = static_cast<std::uint32_t>(i + 1);
      Eigen::VectorXd gone = Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(mesh_.nodes.size()));
      if (planned) gone += planned_m(i);
      if (more_m.size() > 0) gone += std::clamp((i - 3) / 6.0, 0.0, 1.0) * more_m;
      look.displacement_m.assign(gone.data(), gone.data() + gone.size());
      const sim::Picture picture = scene.picture(look);
      writer.add({picture.width, picture.height, 3, picture.rgb});
    }
    writer.finish();
    std::ifstream in(folder_ / "seen.mkv", std::ios::binary);
    const test::RecordedStream film{"endoscope",
                                    "video",
                                    "video/x-matroska",
                                    {to_bytes(std::string{std::istreambuf_iterator<char>(in), {}})},
                                    {kCount}};
    return archive::CaseReader::open(test::record_case(folder_ / "archive", {film}, reader_.recipients));
  }

  /// The plan's own displacement of its mesh in that picture, (3 |V|): its steps are done as fast as planned.
  [[nodiscard]] Eigen::VectorXd planned_m(int picture) const {
    const double at_s = double(picture) / kPictures;
    const std::size_t step = at_s < kWaitsS ? 0 : at_s < kWaitsS + kPressesS ? 1 : 2;
    return frames_->at(step, at_s).frame.displacement_m;
  }

  [[nodiscard]] Comparison compared(const archive::CaseReader& recording, std::int64_t done_until_ns) {
    ByHand by_hand;
    by_hand.steps.emplace();
    const std::array<double, 4> at_s{0, kWaitsS, kWaitsS + kPressesS, kWaitsS + kPressesS + kHoldsS};
    for (std::size_t step = 0; step < 3; ++step) {
      StepMatch& one = by_hand.steps->emplace_back();
      one.step = step;
      one.span = {std::llround(at_s[step] * kSecond),
                  std::min<std::int64_t>(done_until_ns, std::llround(at_s[step + 1] * kSecond))};
    }
    Comparison comparison = compare(recording, reader_.identities, "endoscope", plan_, by_hand, {});
    const PlannedShapes planned(comparison.map, *frames_);
    AlignmentRequest request{{0, 2 * kSecond}, EndoscopeScene::kFieldDeg, {}};
    request.deformed = true;
    request.planned = &planned;
    comparison.alignment = align_organ(recording, reader_.identities, "endoscope", plan_.body, request, {});
    return comparison;
  }

  sim::TetMesh mesh_ = test::liver_like_mesh({16, 5, 12});
  sim::OrganSurface surface_ = sim::organ_surface(mesh_);
  test::TemporaryFolder folder_;
  test::Reader reader_ = test::make_reader();
  sim::Plan plan_;
  std::optional<sim::PlanFrames> frames_;
};

TEST_F(DepartureFromPlan, IsWithinTwoStandardErrorsWhereTheOrganDoesWhatIsPlanned) {
  plan(0.045, 11.5);
  ASSERT_GT(test::PulledOrgan::farthest(planned_m(kCount - 1)), 0.008) << "the plan must do something";
  const archive::CaseReader recording = record();
  // The last step was ended early: nothing is planned for the pictures after that.
  constexpr std::int64_t kUntilNs = (kCount - 2) * kTenthNs;
  const Comparison comparison = compared(recording, kUntilNs);
  const DeformedAlignment& found = *comparison.alignment->deformed;
  ASSERT_EQ(found.departures.size(), found.moments.size());
  const auto document = nlohmann::json::parse(comparison_json(comparison, plan_, {}))["organ_alignment"];
  double told = 0, within = 0;
  std::size_t compared = 0, deformed = 0, without = 0;
  for (std::size_t i = 0; i < found.departures.size(); ++i) {
    const Departure& one = found.departures[i];
    const bool in_plan = comparison.alignment->moments[i].time_ns < kUntilNs;
    ASSERT_EQ(one.moment.has_value(), in_plan) << i;
    std::cout << "picture " << i << ": " << sim::name_of(found.moments[i].why) << ", "
              << sim::name_of(found.moments[i].unfitted) << ", " << name_of(one.why) << ", "
              << 100 * one.beyond << " % beyond two errors of " << 1000 * one.standard_error_m
              << " mm, up to " << 1000 * one.largest_m << " mm\n";
    EXPECT_EQ(document["moments"][i].contains("departure"), one.compared()) << i;
    if (!in_plan && one.why != WhyNoDeparture::kNoShape) {
      EXPECT_EQ(document["moments"][i]["no_departure"], "no-plan-moment") << i;
      ++without;
    }
    if (!one.compared()) continue;
    ++compared;
    if (found.moments[i].deformed()) ++deformed;
    const double nodes = one.told * double(one.beyond_m.size());
    told += nodes;
    within += (1 - one.beyond) * nodes;
  }
  std::cout << 100 * within / told << " % of " << told << " told nodes within two standard errors\n";
  EXPECT_GE(compared, 7U);
  EXPECT_GE(deformed, 2U) << "else what the plan does was not measured";
  EXPECT_GE(without, 1U);
  EXPECT_GE(within, 0.95 * told);
}

TEST_F(DepartureFromPlan, IsFoundWhereAnotherPlaceWasPulled) {
  // The plan hardly touches the organ where it is held. Its left lobe is pulled instead.
  plan(-0.03, 1.6);
  const test::PulledOrgan organ({16, 5, 12});
  ASSERT_EQ(organ.mesh().nodes.size(), mesh_.nodes.size());
  constexpr double kPulledM = 0.015;
  const Eigen::VectorXd more_m =
      organ.displacement_m(organ.force_n({0.05, -0.01, -0.01}, {0.3, -0.2, -1}, kPulledM));
  const archive::CaseReader recording = record(more_m);
  Comparison comparison = compared(recording, 2 * kSecond);
  const Alignment& alignment = *comparison.alignment;
  const DeformedAlignment& found = *alignment.deformed;
  for (std::size_t i = 0; i < found.departures.size(); ++i) {
    const Departure& one = found.departures[i];
    std::cout << "picture " << i << ": " << sim::name_of(found.moments[i].why) << ", "
              << sim::name_of(found.moments[i].unfitted) << ", " << 100 * one.beyond
              << " % beyond two errors of " << 1000 * one.standard_error_m << " mm, up to "
              << 1000 * one.largest_m << " mm\n";
  }
  const auto reversed = std::find_if(found.departures.rbegin(), found.departures.rend(),
                                     [](const Departure& one) { return one.departed(); });
  ASSERT_NE(reversed, found.departures.rend());
  const Departure& last = *reversed;
  const auto picture = static_cast<std::size_t>(&last - found.departures.data());
  EXPECT_GT(picture, 9U) << "pulled all the way";
  const auto farthest =
      static_cast<std::size_t>(std::ranges::max_element(last.beyond_m) - last.beyond_m.begin());
  std::cout << "up to " << 1000 * last.largest_m << " mm of 15 mm, standard error "
            << 1000 * last.largest_error_m << " mm\n";
  EXPECT_NEAR(last.largest_m, kPulledM, 3 * last.largest_error_m);
  ASSERT_EQ(last.beyond_m.size(), surface_.nodes.size());
  EXPECT_GT(more_m.segment<3>(3 * Eigen::Index{surface_.mesh_nodes[farthest]}).norm(), 0.6 * kPulledM);
  // On the other side nothing was pulled.
  for (std::size_t node = 0; node < last.beyond_m.size(); ++node) {
    if (surface_.nodes[node].x() < -0.03) {
      EXPECT_EQ(last.beyond_m[node], 0) << node;
    }
  }

  const std::vector<StepDeparture> steps = alignment.step_departures();
  ASSERT_EQ(steps.size(), 3U);
  EXPECT_EQ(steps[0].pictures, 4U);
  EXPECT_EQ(steps[0].departed, 0U);
  EXPECT_GE(steps[2].departed, 2U);

  // In the document.
  const auto told = nlohmann::json::parse(comparison_json(comparison, plan_, {}))["organ_alignment"];
  const auto& all = told["departure"];
  EXPECT_EQ(all["scale_mm"], found.departure_scale_mm());
  EXPECT_EQ(all["errors"], 2);
  EXPECT_EQ(all["steps"][2]["step"], 3);
  EXPECT_EQ(all["steps"][2]["departed"], steps[2].departed);
  EXPECT_NEAR(all["steps"][2]["largest_mm"].get<double>(), 1000 * steps[2].largest_m, 0.006);
  EXPECT_EQ(all["steps"][2]["at_ns"], steps[2].at_ns);
  EXPECT_FALSE(all["steps"][0].contains("largest_mm"));
  const auto& written = told["moments"][picture]["departure"];
  EXPECT_EQ(written["step"], 3);
  EXPECT_NEAR(written["plan_s"].get<double>(), double(picture) / kPictures, 1e-9);
  EXPECT_NEAR(written["largest_mm"].get<double>(), 1000 * last.largest_m, 0.006);
  // Whoever reads the document comes to the same departures, within a seventh of the scale.
  const std::string text = written["nodes"];
  ASSERT_EQ(text.size(), (last.beyond_m.size() + 1) / 2);
  const std::string alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (std::size_t node = 0; node < last.beyond_m.size(); ++node) {
    const std::size_t digit = alphabet.find(text[node / 2]);
    const double level = double(node % 2 == 0 ? digit / 8 : digit % 8);
    const double mm = 1000 * last.beyond_m[node], seventh_mm = found.departure_scale_mm() / 7;
    ASSERT_LE(mm, level * seventh_mm + 1e-6) << node;
    ASSERT_GE(mm, (level - 1) * seventh_mm) << node;
  }

  // On the film, and on the page for people.
  sim::Scene scene;
  constexpr int kWide = 320, kHigh = 240;
  scene.width = kWide;
  scene.height = kHigh;
  scene.background = {0, 0, 0};
  const sim::Vector3 corner(0.09, 0.04, 0.06);
  const sim::Volume ct =
      test::volume_of({90, 40, 60}, 2e-3, -corner, [](const sim::Vector3&) { return 100.0; });
  sim::PlanPictures pictures(plan_,
                             std::make_shared<const sim::ShadedVolume>(sim::shade(ct, {-corner, corner})),
                             sim::find_transfer_function("liver"), sim::GpuUse::kOff, scene);
  CompositionForm form;
  form.width = kWide;
  form.height = kHigh;
  form.arrangement = Arrangement::kOverlay;
  form.share = 1;
  form.from_plan = true;
  PairedPictures paired(recording, reader_.identities, comparison, *frames_, pictures, form, 0, 2 * kSecond);
  const sim::Picture film = paired.at(static_cast<std::int64_t>(picture) * kTenthNs);
  const Caption caption = paired.caption_at(static_cast<std::int64_t>(picture) * kTenthNs);
  EXPECT_THAT(caption.step, HasSubstr("organ departs from the plan by up to "));
  EXPECT_EQ(caption.displacement_mm, found.departure_scale_mm());
  EXPECT_EQ(caption.scale_title, "mm from plan");
  int grey = 0;
  for (int y = 0; y < film.height; ++y) {
    for (int x = 0; x < (y < film.height * 3 / 4 ? kWide * 3 / 4 : kWide); ++x) {  // beside the scale
      const std::uint8_t* const pixel = film.pixel(x, y);
      if (pixel[0] == 150 && pixel[1] == 150 && pixel[2] == 150) ++grey;
    }
  }
  EXPECT_GT(grey, 2000);
  EXPECT_THAT(comparison_html(comparison, plan_, {}, {}), HasSubstr("by up to"));
}

/// A fit of which each node is known to 2 mm, and a plan that lifts the whole organ by a centimetre.
struct Fitted {
  sim::OrganSurface surface = sim::organ_surface(test::liver_like_mesh({8, 3, 6}));
  sim::DrawnSurface drawn = sim::drawn_surface(surface, kMostDeformedNodes);
  sim::DeformedMoment moment;
  PlannedShapes::Shape planned;

  Fitted() {
    const std::size_t nodes = surface.nodes.size();
    moment.why = sim::WhyRigid::kDeformed;
    moment.displacement_m.assign(nodes, {0, 0.001, 0.01});
    moment.error_m.assign(nodes, 0.002F);
    moment.told.assign(nodes, true);
    planned.why = WhyNoDeparture::kCompared;
    planned.moment = {1, 0.5, false};
    planned.displacement_m.assign(nodes, {0, 0, 0.01});
  }
  [[nodiscard]] Departure departure() const { return departure_of(moment, planned, drawn); }
};

TEST(DepartureOf, IsNoneWithinTwoStandardErrorsOfThePlanHoweverFarFromRest) {
  const Departure one = Fitted().departure();
  ASSERT_TRUE(one.compared());
  EXPECT_FALSE(one.departed());
  EXPECT_EQ(one.moment->step, 1U);
  EXPECT_EQ(one.told, 1);
  EXPECT_EQ(one.beyond, 0);
  EXPECT_NEAR(one.standard_error_m, 0.002, 1e-8);
  EXPECT_EQ(std::ranges::count(one.beyond_m, 0.0F), std::ssize(one.beyond_m));
}

TEST(DepartureOf, LiesWhereAnotherPlaceWasPulled) {
  Fitted fitted;
  const sim::Vector3 spot_m = fitted.surface.nodes[7];
  std::size_t pulled = 0;
  for (std::size_t node = 0; node < fitted.surface.nodes.size(); ++node) {
    const double away = (fitted.surface.nodes[node] - spot_m).norm() / 0.03;
    const sim::Vector3 more(0.015 * std::exp(-away * away), 0, 0);
    fitted.moment.displacement_m[node] = fitted.planned.displacement_m[node] + more;
    if (more.norm() > 0.00401) ++pulled;
  }
  const Departure one = fitted.departure();
  EXPECT_TRUE(one.departed());
  EXPECT_NEAR(one.largest_m, 0.015, 1e-8);
  EXPECT_NEAR(one.largest_error_m, 0.002, 1e-8);
  EXPECT_NEAR(one.beyond_m[7], 0.015, 1e-8);
  EXPECT_NEAR(one.beyond * double(one.beyond_m.size()), double(pulled), 1.5);
  // What is not told says nothing, however far it seems to be.
  fitted.moment.told.assign(fitted.moment.told.size(), false);
  EXPECT_EQ(fitted.departure().why, WhyNoDeparture::kUntold);
  fitted.moment.told.assign(fitted.moment.told.size(), true);
  fitted.moment.told[7] = false;
  EXPECT_EQ(fitted.departure().beyond_m[7], 0);
  EXPECT_LT(fitted.departure().largest_m, 0.015);
}

TEST(DepartureOf, IsOnlyToldOfAShapeThatIsKnownAndAMomentOfThePlan) {
  Fitted fitted;
  fitted.moment.why = sim::WhyRigid::kWithinError;
  EXPECT_TRUE(fitted.departure().compared()) << "it agrees with the plan";
  Fitted resting;
  resting.moment.why = sim::WhyRigid::kWithinError;
  resting.moment.displacement_m.assign(resting.moment.displacement_m.size(), sim::Vector3::Zero());
  EXPECT_EQ(resting.departure().why, WhyNoDeparture::kUnsure) << "a fit that sees little says rest as well";
  for (const sim::WhyRigid why : {sim::WhyRigid::kAtRest, sim::WhyRigid::kMoved, sim::WhyRigid::kUnseen,
                                  sim::WhyRigid::kUnfitted, sim::WhyRigid::kNotBetter}) {
    fitted.moment.why = why;
    EXPECT_EQ(fitted.departure().why, WhyNoDeparture::kNoShape) << sim::name_of(why);
  }
  fitted.moment.why = sim::WhyRigid::kDeformed;
  for (const WhyNoDeparture why : {WhyNoDeparture::kNoMoment, WhyNoDeparture::kCut}) {
    fitted.planned.why = why;
    fitted.planned.displacement_m.clear();
    EXPECT_EQ(fitted.departure().why, why);
    EXPECT_EQ(fitted.departure().moment.has_value(), why == WhyNoDeparture::kCut);
  }
}

TEST(TimeMapDuring, HasAMomentOnlyWhileAStepIsDone) {
  const std::vector<PlannedStep> steps{{"a", 0, 1}, {"b", 1, 1}};
  StepMatching matching;
  matching.matches.resize(2);
  matching.matches[0].span = {10, 20};
  matching.matches[1].step = 1;
  matching.matches[1].span = {30, 50};
  matching.matches[1].pauses = {{35, 40}};
  const TimeMap map(steps, matching);
  EXPECT_FALSE(map.during(9));
  EXPECT_EQ(map.during(10)->step, 0U);
  EXPECT_FALSE(map.during(20)) << "between two steps";
  EXPECT_FALSE(map.during(29));
  EXPECT_TRUE(map.during(37)->stands) << "a pause is part of its step";
  EXPECT_EQ(map.during(37)->step, 1U);
  EXPECT_FALSE(map.during(50));
}

}  // namespace
}  // namespace kiroku::compare::departures

// Points picked on a plan's pictures.
#include "viewer/compare/organ_picking.h"

#include <cmath>
#include <fstream>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "crypto/encoding.h"
#include "sim/render/picking.h"
#include "sim/volume/volume_reader.h"
#include "tests/support/cube_plan.h"
#include "tests/support/temporary_folder.h"
#include "viewer/compare/registration.h"

namespace kiroku::compare {
namespace {

using nlohmann::json;
using sim::Vector3;
using testing::HasSubstr;

constexpr int kPickingWidth = 320, kPickingHeight = 240;

/// A cube of 10 mm; its second step lifts the top by up to 2 mm.
class OrganPickingTest : public testing::Test {
 protected:
  OrganPickingTest() {
    test::write_cube_plan(folder_.path());
    sim::PlanReading reading = sim::read_plan(folder_ / "plan.json");
    EXPECT_THAT(reading.errors, testing::IsEmpty());
    plan_ = *reading.plan;
    frames_.emplace(*plan_);
    picking_.emplace(*plan_, *frames_,
                     std::make_shared<const sim::ShadedVolume>(sim::shade(
                         sim::read_volume(plan_->volume, {}).volume, sim::extent_of(plan_->body.mesh), {})),
                     sim::find_transfer_function("liver"), sim::GpuUse::kOff);
  }
  static PickingView view(std::size_t step, double plan_s, double azimuth_deg = 30,
                          double elevation_deg = 20) {
    return {step, plan_s, azimuth_deg, elevation_deg, 1.2, 0.05, -0.02, kPickingWidth, kPickingHeight};
  }
  /// As a part of the picture.
  [[nodiscard]] Eigen::Vector2d seen(const PickingView& from, const Vector3& point_m) const {
    const Eigen::Vector2d pixel = *pixel_of(picking_->camera(from), point_m, kPickingWidth, kPickingHeight);
    return {(pixel.x() + 0.5) / kPickingWidth, (pixel.y() + 0.5) / kPickingHeight};
  }
  json answer(const json& question) { return json::parse(answer_picking(*picking_, question.dump())); }
  static json asked(const PickingView& from) {
    return {{"step", from.step + 1},
            {"plan_s", from.plan_s},
            {"azimuth_deg", from.azimuth_deg},
            {"elevation_deg", from.elevation_deg},
            {"zoom", from.zoom},
            {"pan_x", from.pan_x},
            {"pan_y", from.pan_y},
            {"width", from.width},
            {"height", from.height}};
  }

  test::TemporaryFolder folder_;
  std::optional<sim::Plan> plan_;
  std::optional<sim::PlanFrames> frames_;
  std::optional<OrganPicking> picking_;
};

TEST_F(OrganPickingTest, TellsTheNearestPointOfTheOrganUnderAPlace) {
  const PickingView from = view(0, 0);
  // On the front, the left side and the top, which are seen from there; not their edges.
  for (const Vector3& mm : {Vector3(5, 0, 5), Vector3(2, 0, 7), Vector3(10, 4, 3), Vector3(6, 6, 10)}) {
    const Eigen::Vector2d at = seen(from, mm * 1e-3);
    const auto found = picking_->organ_at(from, at.x(), at.y());
    ASSERT_TRUE(found) << mm.transpose();
    EXPECT_LT((*found * 1e3 - mm).norm(), 1e-6) << mm.transpose();
  }
  // What lies behind is not picked through.
  const Vector3 behind(5, 10, 5);
  const Eigen::Vector2d at = seen(from, behind * 1e-3);
  EXPECT_GT((*picking_->organ_at(from, at.x(), at.y()) * 1e3 - behind).norm(), 1);
  EXPECT_FALSE(picking_->organ_at(from, 0.01, 0.01)) << "beside the organ";
}

TEST_F(OrganPickingTest, TakesTheOrganAsItLiesAtThatMoment) {
  // A corner of the top that the forceps hold, at the end of the lift.
  const sim::PlanFrames::Kept& end = frames_->at(1, 1);
  const Vector3 rest = end.mesh->nodes[4], moved = rest + end.frame.displacement_m.segment<3>(12);
  ASSERT_GT((moved - rest).norm(), 1e-3);
  // A little inside of its faces.
  const Vector3 middle = end.mesh->nodes[5] + end.frame.displacement_m.segment<3>(15);
  const Vector3 on_edge = 0.5 * (moved + middle);
  const PickingView from = view(1, 1, 0, 40);
  const Eigen::Vector2d at = seen(from, on_edge);
  // Just below the edge: on the front.
  const auto found = picking_->organ_at(from, at.x(), at.y() + 0.01);
  ASSERT_TRUE(found);
  EXPECT_LT((*found - on_edge).norm(), 6e-4);
}

TEST_F(OrganPickingTest, ShowsTheOrganWhereItIsPicked) {
  const PickingView from = view(0, 0);
  const json told = answer({{"picture", asked(from)}});
  const auto jpeg = crypto::from_base64(told["jpeg"].get<std::string>(), crypto::Base64Padding::kPadded);
  ASSERT_TRUE(jpeg);
  EXPECT_GT(jpeg->size(), 1000U);
  EXPECT_EQ((*jpeg)[0], std::byte{0xff});
  // The camera that it tells sees as the one that is picked by.
  const sim::Camera camera = picking_->camera(from);
  const auto eye = told["camera"]["eye"].get<std::vector<double>>(),
             axes = told["camera"]["view_axes"].get<std::vector<double>>();
  EXPECT_LT((Vector3(eye.data()) - 1e3 * camera.eye_m).norm(), 1e-9);
  using Rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  EXPECT_LT((Rows(axes.data()) - camera.to_view).norm(), 1e-12);
  // Tissue is in the picture where there is an organ, and none where there is not.
  const sim::Picture picture = picking_->picture(from);
  const auto light = [&](const Eigen::Vector2d& at) {
    const auto rgb =
        picture.pixel(static_cast<int>(at.x() * kPickingWidth), static_cast<int>(at.y() * kPickingHeight));
    return int(rgb[0]) + int(rgb[1]) + int(rgb[2]);
  };
  EXPECT_GT(light(seen(from, {5e-3, 0, 5e-3})), light({0.01, 0.01}) + 60);
}

TEST_F(OrganPickingTest, SaysHowWellPointsRegisterACamera) {
  PickingView from = view(0, 0);
  from.pan_x = from.pan_y = 0;  // an endoscope's axis goes through the middle
  json points = json::array();
  for (const Vector3& mm : {Vector3(1, 0, 1), Vector3(9, 0, 1), Vector3(1, 0, 9), Vector3(10, 8, 2),
                            Vector3(10, 3, 8), Vector3(3, 8, 10)}) {
    const Eigen::Vector2d at = seen(from, mm * 1e-3);
    const json picked = answer({{"point", [&] {
                                   json one = asked(from);
                                   one["x"] = at.x();
                                   one["y"] = at.y();
                                   return one;
                                 }()}});
    ASSERT_FALSE(picked["organ"].is_null()) << mm.transpose();
    points.push_back({{"organ", picked["organ"]},
                      {"pixel", {at.x() * kPickingWidth - 0.5, at.y() * kPickingHeight - 0.5}}});
  }
  const auto judged = [&](const json& some, const json& field) {
    json said{{"width", kPickingWidth}, {"height", kPickingHeight}, {"points", some}};
    if (!field.is_null()) said["field_deg"] = field;
    return answer({{"registration", said}});
  };
  const double field_deg =
      2 * std::atan(picking_->camera(from).half_extent.minCoeff()) * 180 / std::numbers::pi;
  const json known = judged(points, field_deg);
  EXPECT_LT(known.value("rms_px", 99.0), 0.01) << known;
  EXPECT_EQ(known["error_px"].size(), 6U);
  EXPECT_EQ(known["field_estimated"], false);
  const json estimated = judged(points, nullptr);
  EXPECT_NEAR(estimated.value("field_deg", 0.0), field_deg, 0.5) << estimated;
  EXPECT_EQ(estimated["field_estimated"], true);
  const json few{points[0], points[1], points[2]};
  EXPECT_THAT(judged(few, field_deg)["problem"].get<std::string>(), HasSubstr("pick at least 4"));
}

TEST_F(OrganPickingTest, RefusesInWordsWhatIsNoQuestion) {
  const auto refused = [&](const std::string& text) {
    return json::parse(answer_picking(*picking_, text)).value("refused", "");
  };
  EXPECT_NE(refused("x"), "");
  EXPECT_NE(refused("[]"), "");
  EXPECT_THAT(refused(R"({"sing": 1})"), HasSubstr("sing"));
  for (const auto& [key, value] : std::vector<std::pair<std::string, json>>{{"step", 0},
                                                                            {"step", 4},
                                                                            {"zoom", 0},
                                                                            {"width", 1e9},
                                                                            {"height", 3},
                                                                            {"plan_s", "x"},
                                                                            {"azimuth_deg", nullptr},
                                                                            {"elevation_deg", 91},
                                                                            {"file", "/etc/passwd"}}) {
    json question = asked(view(0, 0));
    question[key] = value;
    EXPECT_THAT(refused(json{{"picture", question}}.dump()), HasSubstr(key)) << key;
  }
  json outside = asked(view(0, 0));
  outside["x"] = 1.5;
  outside["y"] = 0;
  EXPECT_THAT(refused(json{{"point", outside}}.dump()), HasSubstr("point.x"));
}

}  // namespace
}  // namespace kiroku::compare

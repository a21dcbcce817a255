#include "viewer/compare/organ_picking.h"

#include <cmath>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "crypto/encoding.h"
#include "sim/model/json_field.h"
#include "sim/render/picking.h"
#include "sim/render/picture_jpeg.h"
#include "viewer/compare/registration.h"

namespace kiroku::compare {
namespace {

using nlohmann::ordered_json;
using sim::JsonField;
using sim::Vector3;

constexpr int kQuality = 90;
constexpr int kLeastSide = 64, kMostSide = 2048;
constexpr std::size_t kMostPoints = 100;

double number_of(const JsonField& object, const char* key, double least, double most) {
  const JsonField field = object.member(key);
  const double value = field.number();
  if (value < least || value > most)
    field.fail("must lie between " + nlohmann::json(least).dump() + " and " + nlohmann::json(most).dump());
  return value;
}

int side_of(const JsonField& object, const char* key) {
  return static_cast<int>(std::lround(number_of(object, key, kLeastSide, kMostSide)));
}

PickingView view_of(const JsonField& asked, const sim::Plan& plan) {
  constexpr double kTurn = 360, kUp = 90, kLeastZoom = 0.25, kMostZoom = 10, kMostPan = 5, kLongestS = 1e6;
  PickingView view;
  const double step = number_of(asked, "step", 1, double(plan.steps.size()));
  view.step = static_cast<std::size_t>(std::lround(step)) - 1;
  view.plan_s = number_of(asked, "plan_s", 0, kLongestS);
  view.azimuth_deg = number_of(asked, "azimuth_deg", -kTurn, kTurn);
  view.elevation_deg = number_of(asked, "elevation_deg", -kUp, kUp);
  view.zoom = number_of(asked, "zoom", kLeastZoom, kMostZoom);
  view.pan_x = number_of(asked, "pan_x", -kMostPan, kMostPan);
  view.pan_y = number_of(asked, "pan_y", -kMostPan, kMostPan);
  view.width = side_of(asked, "width");
  view.height = side_of(asked, "height");
  return view;
}

template <typename Vector>
ordered_json numbers(const Vector& values) {
  ordered_json all = ordered_json::array();
  for (const double value : values) all.push_back(value);
  return all;
}

/// In the plan's unit, as what is picked.
ordered_json camera_json(const sim::Camera& camera, double units_per_metre) {
  return {{"eye", numbers(Vector3(units_per_metre * camera.eye_m))},
          {"view_axes", numbers(camera.to_view.transpose().reshaped())},
          {"half_extent", numbers(camera.half_extent)},
          {"centre", numbers(camera.centre)}};
}

ordered_json picture_answer(OrganPicking& picking, const JsonField& asked) {
  asked.expect_object(
      {"step", "plan_s", "azimuth_deg", "elevation_deg", "zoom", "pan_x", "pan_y", "width", "height"});
  const PickingView view = view_of(asked, picking.plan());
  const double units = sim::units_per_metre(picking.plan().body.unit);
  return {{"jpeg",
           crypto::to_base64(sim::jpeg_of(picking.picture(view), kQuality), crypto::Base64Padding::kPadded)},
          {"camera", camera_json(picking.camera(view), units)}};
}

ordered_json point_answer(OrganPicking& picking, const JsonField& asked) {
  asked.expect_object({"step", "plan_s", "azimuth_deg", "elevation_deg", "zoom", "pan_x", "pan_y", "width",
                       "height", "x", "y"});
  const PickingView view = view_of(asked, picking.plan());
  const auto point_m = picking.organ_at(view, number_of(asked, "x", 0, 1), number_of(asked, "y", 0, 1));
  if (!point_m) return {{"organ", nullptr}};
  return {{"organ", numbers(Vector3(sim::units_per_metre(picking.plan().body.unit) * *point_m))}};
}

ordered_json registration_answer(const OrganPicking& picking, const JsonField& asked) {
  asked.expect_object({"width", "height", "field_deg", "points"});
  const double units = sim::units_per_metre(picking.plan().body.unit);
  std::vector<PickedPoint> points;
  const std::vector<JsonField> given = asked.member("points").elements();
  if (given.size() > kMostPoints) asked.member("points").fail("holds more than 100 points");
  for (const JsonField& point : given) {
    point.expect_object({"organ", "pixel"});
    const std::vector<JsonField> pixel = point.member("pixel").elements(2);
    points.push_back({point.member("organ").vector() / units, {pixel[0].number(), pixel[1].number()}});
  }
  const auto field_deg = asked.optional_member("field_deg");
  constexpr double kMostPixels = 16384;
  const int width = static_cast<int>(number_of(asked, "width", 1, kMostPixels)),
            height = static_cast<int>(number_of(asked, "height", 1, kMostPixels));
  try {
    const Registration found =
        register_camera(points, width, height, field_deg ? std::optional(field_deg->number()) : std::nullopt);
    return {{"rms_px", found.rms_px},
            {"error_px", numbers(found.error_px)},
            {"field_deg", found.field_deg},
            {"field_estimated", found.field_estimated}};
  } catch (const UsageError& error) {
    return {{"problem", error.what()}};  // an answer: these points say too little
  }
}

}  // namespace

OrganPicking::OrganPicking(const sim::Plan& plan, const sim::PlanFrames& frames,
                           std::shared_ptr<const sim::ShadedVolume> volume,
                           const sim::TransferFunction& transfer, const sim::EngineChoice& choice)
    : plan_(plan), frames_(frames), pictures_(plan, std::move(volume), transfer, choice, {}) {}

sim::Camera OrganPicking::camera(const PickingView& view) const {
  sim::Camera camera = sim::camera_looking_at(
      sim::view_of_plan(plan_), {view.azimuth_deg, view.elevation_deg}, view.width, view.height, view.zoom);
  camera.centre = {-2 * view.pan_x * camera.half_extent.x(), 2 * view.pan_y * camera.half_extent.y()};
  return camera;
}

sim::Picture OrganPicking::picture(const PickingView& view) {
  pictures_.set_size(view.width, view.height, 0);
  pictures_.set_camera(camera(view));
  const sim::PlanFrames::Kept& kept = frames_.at(view.step, view.plan_s);
  return pictures_.picture(kept.frame, *kept.mesh);
}

std::optional<Vector3> OrganPicking::organ_at(const PickingView& view, double x, double y) {
  const sim::PlanFrames::Kept& kept = frames_.at(view.step, view.plan_s);
  if (faces_of_ != kept.mesh) {
    surface_ = sim::faces_of(*kept.mesh).surface;
    faces_of_ = kept.mesh;
  }
  const sim::Camera from = camera(view);
  const Eigen::VectorXd& moved_m = kept.frame.displacement_m;
  std::vector<Vector3> places_m(kept.mesh->nodes.size());
  for (std::size_t node = 0; node < places_m.size(); ++node) {
    places_m[node] = sim::in_depth_m(
        from, kept.mesh->nodes[node] + moved_m.segment<3>(static_cast<Eigen::Index>(3 * node)));
  }
  const Eigen::Vector2d slope = sim::slope_of(from, x, y);
  const auto depth_m = sim::depth_along(surface_, places_m, slope);
  if (!depth_m) return {};
  return sim::from_depth_m(from, {slope.x() * *depth_m, slope.y() * *depth_m, *depth_m});
}

std::string answer_picking(OrganPicking& picking, std::string_view question) {
  const std::string name = "the question";
  try {
    const nlohmann::json document = JsonField::parse(question, name);
    const JsonField asked(document, name);
    asked.expect_object({"picture", "point", "registration"});
    if (const auto picture = asked.optional_member("picture"))
      return picture_answer(picking, *picture).dump();
    if (const auto point = asked.optional_member("point")) return point_answer(picking, *point).dump();
    return registration_answer(picking, asked.member("registration")).dump();
  } catch (const Error& error) {
    return ordered_json{{"refused", error.what()}}.dump();
  }
}

}  // namespace kiroku::compare

#include "viewer/planning/planning_messages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <nlohmann/json.hpp>

#include "base/foreign_json.h"
#include "sim/fem/element.h"
#include "sim/render/picture_jpeg.h"
#include "viewer/http/message_fields.h"
#include "viewer/http/picture_message.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr int kQuality = 85;
constexpr std::size_t kMostPlaces = 1000;
constexpr double kOutside = 0.5;  // of the picture, where pointers may have left it to
constexpr double kMostPushM = 0.2, kMostTurnDeg = 36000, kMostLeanDeg = 180, kMostDepthM = 0.3,
                 kMostHoldS = 60, kMostPa = 1e9;

constexpr std::array<std::pair<const char*, PointerUse>, 4> kUses{{{"grasp", PointerUse::kGrasp},
                                                                   {"pinch", PointerUse::kPinch},
                                                                   {"clip", PointerUse::kClip},
                                                                   {"press", PointerUse::kPress}}};
/// Of what jaws are apart: a message closes or opens them by no more.
constexpr double kLeastShare = 0.5, kMostShare = 2;

double place(const json& object, const char* key) {
  return message_number(object, key, -kOutside, 1 + kOutside);
}

ViewDeed view_of(const json& view) {
  return {message_number(view, "azimuth_deg", -360, 360), message_number(view, "elevation_deg", -90, 90),
          message_number(view, "zoom", 0.25, 10), message_number(view, "pan_x", -5, 5),
          message_number(view, "pan_y", -5, 5)};
}

PointDeed pointers_of(const json& object) {
  const json& pointers = message_field(object, "pointers");
  if (!pointers.is_array() || pointers.size() > kMostPlanPointers)
    throw Refusal(400, "'pointers' must be a list of at most 5");
  const std::string use = message_text(object, "use");
  const auto* const known = std::ranges::find(kUses, use, &std::pair<const char*, PointerUse>::first);
  if (known == kUses.end()) throw Refusal(400, "'use' must be 'grasp', 'pinch', 'clip' or 'press'");
  PointDeed deed{known->second, {}};
  for (const json& pointer : pointers) {
    const std::uint64_t id = message_count(pointer, "id");
    if (id > std::numeric_limits<std::uint32_t>::max()) throw Refusal(400, "'id' is too large");
    const auto angle = [&](const char* key, double most_deg) {
      return pointer.contains(key) ? message_number(pointer, key, -most_deg, most_deg) : 0;
    };
    const PlanPointer one{static_cast<std::uint32_t>(id),
                          place(pointer, "x"),
                          place(pointer, "y"),
                          message_number(pointer, "push_m", -kMostPushM, kMostPushM),
                          angle("turn_deg", kMostTurnDeg),
                          angle("lean_x_deg", kMostLeanDeg),
                          angle("lean_y_deg", kMostLeanDeg)};
    if (std::ranges::find(deed.pointers, one.id, &PlanPointer::id) != deed.pointers.end())
      throw Refusal(400, "an 'id' stands twice");
    deed.pointers.push_back(one);
  }
  return deed;
}

CutDeed cut_of(const json& cut) {
  const json& line = message_field(cut, "line");
  if (!line.is_array() || line.size() < 2 || line.size() > kMostPlaces)
    throw Refusal(400, "'line' must be a list of 2 to 1000 places");
  CutDeed deed{{}, message_number(cut, "depth_m", 1e-4, kMostDepthM)};
  for (const json& at : line) deed.line.emplace_back(place(at, "x"), place(at, "y"));
  return deed;
}

HandleDeed handle_of(const json& handle) {
  HandleDeed deed{message_count(handle, "step"), message_count(handle, "handle"), {}, {}};
  if (handle.contains("x") || handle.contains("y")) deed.at = {place(handle, "x"), place(handle, "y")};
  if (handle.contains("depth_m")) deed.depth_m = message_number(handle, "depth_m", 1e-4, kMostDepthM);
  if (!deed.at && !deed.depth_m) throw Refusal(400, "'handle' must have 'x' and 'y', 'depth_m', or both");
  return deed;
}

Deed deed_of(const json& object) {
  if (object.contains("view")) return view_of(object["view"]);
  if (object.contains("pointers")) return pointers_of(object);
  if (object.contains("cut")) return cut_of(object["cut"]);
  if (object.contains("handle")) return handle_of(object["handle"]);
  if (object.contains("hold"))
    return HoldDeed{message_number(object["hold"], "duration_s", 1e-3, kMostHoldS)};
  if (object.contains("release")) return ReleaseDeed{message_text(object["release"], "tool")};
  if (object.contains("close")) {
    const json& close = object["close"];
    return CloseDeed{message_text(close, "tool"), message_number(close, "share", kLeastShare, kMostShare)};
  }
  if (object.contains("undo")) return UndoDeed{};
  if (object.contains("redo")) return RedoDeed{};
  if (object.contains("stress")) {
    const json& stress = object["stress"];
    if (stress.is_null()) return StressDeed{};
    return StressDeed{message_number(stress, "largest_pa", 1e-3, kMostPa)};
  }
  throw Refusal(
      400,
      "a message must have 'open', 'view', 'pointers', 'cut', 'handle', 'hold', 'release', 'close', 'undo', "
      "'redo', 'stress' or 'save'");
}

double ms(std::chrono::nanoseconds time) { return static_cast<double>(time.count()) / 1e6; }

ordered_json tools_json(const PlanningTable& table) {
  ordered_json tools = ordered_json::array();
  const sim::PlanFrame& frame = table.session().frame();
  for (std::size_t i = 0; i < frame.poses.size(); ++i) {
    if (!frame.poses[i]) continue;
    const sim::PlanTool& tool = table.session().plan().tools[i];
    const Eigen::Vector2d at = table.on_picture(frame.poses[i]->position_m);
    tools.push_back({{"name", tool.tool.name},
                     {"kind", sim::name_of(tool.kind)},
                     {"force_n", frame.tools[i].force_n.norm()},
                     {"nodes", frame.tools[i].nodes},
                     {"x", at.x()},
                     {"y", at.y()}});
    if (!sim::closes(tool.kind)) continue;
    const sim::PlanGrip& grip = frame.grips[i];
    tools.back()["jaws"] = {{"opening_m", grip.opening_m},
                            {"squeeze_n", grip.grip.squeeze_n},
                            {"pull_n", grip.grip.pull_n},
                            {"most_pull_n", grip.grip.most_pull_n},
                            {"slipped_m", grip.slipped_m},
                            {"slips", grip.slips},
                            {"left", grip.left}};
  }
  return tools;
}

ordered_json cuts_json(const PlanningTable& table) {
  ordered_json cuts = ordered_json::array();
  for (const ShownCut& cut : table.cuts()) {
    ordered_json handles = ordered_json::array();
    for (const ShownHandle& handle : cut.handles) {
      handles.push_back(
          {{"x", handle.x}, {"y", handle.y}, {"depth_m", handle.depth_m}, {"hidden", handle.hidden}});
    }
    cuts.push_back({{"step", cut.step}, {"smooth", cut.smooth}, {"handles", std::move(handles)}});
  }
  return cuts;
}

}  // namespace

PlanningMessage parse_planning_message(std::string_view message) {
  const json object = parse_foreign_json(message);
  if (!object.is_object()) throw Refusal(400, "a message must be a JSON object");
  if (object.contains("open")) {
    const json& open = object["open"];
    const bool anew = message_flag(open, "anew");
    return OpenMessage{message_text(open, "plan"), anew};
  }
  const std::uint64_t input = message_count(object, "input");
  if (object.contains("save"))
    return SaveMessage{input, message_text(object["save"], "file"), message_text(object["save"], "name")};
  return DeedMessage{input, deed_of(object)};
}

ordered_json opened_json(const PlanningTable& table) {
  const sim::Plan& plan = table.session().plan();
  return {{"opened",
           {{"plan", table.opened().file},
            {"name", plan.name},
            {"vertices", plan.body.mesh.nodes.size()},
            {"time_step_s", plan.time_step_s},
            {"warnings", plan.body.warnings},
            {"renderer", table.renderer()}}}};
}

ordered_json steps_json(const PlanningTable& table) {
  const sim::PlanSession& session = table.session();
  ordered_json steps = ordered_json::array();
  for (const sim::PlanStep& step : session.plan().steps) {
    ordered_json tools = ordered_json::array();
    for (const sim::PlanMotion& motion : step.motions)
      tools.push_back(session.plan().tools[motion.tool].tool.name);
    for (const std::size_t tool : step.released) tools.push_back(session.plan().tools[tool].tool.name);
    steps.push_back({{"name", step.name},
                     {"action", sim::name_of(step.action)},
                     {"tools", std::move(tools)},
                     {"duration_s", step.duration_s}});
  }
  return {{"steps", std::move(steps)}, {"undo", session.can_undo()}, {"redo", session.can_redo()}};
}

Bytes moment_message(const PlanningMoment& moment) {
  const sim::PlanFrame& frame = moment.table->session().frame();
  double largest_pa = 0, moved_m = 0;
  for (const sim::SymmetricTensor& stress : frame.stress_pa)
    largest_pa = std::max(largest_pa, sim::von_mises(stress));
  for (Eigen::Index at = 0; at < frame.displacement_m.size(); at += 3)
    moved_m = std::max(moved_m, frame.displacement_m.segment<3>(at).norm());
  return picture_message({{"picture", moment.number},
                          {"input", moment.input},
                          {"time_s", frame.time_s},
                          {"moves", moment.moves},
                          {"tools", tools_json(*moment.table)},
                          {"cuts", cuts_json(*moment.table)},
                          {"largest_von_mises_pa", largest_pa},
                          {"largest_displacement_m", moved_m},
                          {"computing_ms", ms(moment.computing)},
                          {"drawing_ms", ms(moment.drawing)}},
                         sim::jpeg_of(*moment.picture, kQuality));
}

}  // namespace kiroku::viewer

#include "viewer/compare/comparison_document.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include <nlohmann/json.hpp>

#include "base/json_or_null.h"
#include "crypto/encoding.h"

namespace kiroku::compare {
namespace {

using nlohmann::ordered_json;

ordered_json span_json(const archive::Span& span) {
  return {{"start_ns", span.start_ns}, {"end_ns", span.end_ns}};
}

ordered_json marks_json(const std::vector<Mark>& marks) {
  ordered_json all = ordered_json::array();
  for (const Mark& mark : marks) all.push_back({{"time_ns", mark.time_ns}, {"text", mark.text}});
  return all;
}

ordered_json vitals_json(const std::vector<VitalChange>& vitals) {
  ordered_json all = ordered_json::array();
  for (const VitalChange& change : vitals) {
    all.push_back({{"code", change.code},
                   {"label", change.label},
                   {"unit", change.unit},
                   {"device", or_null(change.device)},
                   {"before", or_null(change.before)},
                   {"during", or_null(change.during)},
                   {"after", or_null(change.after)}});
  }
  return all;
}

ordered_json events_json(const std::vector<PressureEvent>& events) {
  ordered_json all = ordered_json::array();
  for (const PressureEvent& event : events) {
    ordered_json one{{"time_ns", event.time_ns},
                     {"kind", event.is_alarm ? "alarm" : "limit"},
                     {"text", event.text},
                     {"code", event.code}};
    if (event.value_mmhg) one["value_mmhg"] = *event.value_mmhg;
    all.push_back(std::move(one));
  }
  return all;
}

ordered_json steps_json(const Comparison& comparison) {
  ordered_json all = ordered_json::array();
  for (const StepFigures& figures : comparison.figures) {
    const PlannedStep& planned = comparison.steps[figures.step];
    ordered_json one{{"step", figures.step + 1},
                     {"name", planned.name},
                     {"planned", {{"start_s", planned.start_s}, {"duration_s", planned.duration_s}}}};
    if (const StepMatch* const match = comparison.matching.match_of(figures.step)) {
      ordered_json done = span_json(match->span);
      done["order"] = *figures.done_as + 1;
      done["start_from"] = name_of(match->start_from);
      done["end_from"] = name_of(match->end_from);
      if (!match->mark.empty()) done["mark"] = match->mark;
      done["pauses"] = ordered_json::array();
      for (const archive::Span& pause : match->pauses) done["pauses"].push_back(span_json(pause));
      done["pause_before_ns"] = or_null(figures.pause_before_ns);
      one["done"] = std::move(done);
      one["vitals"] = vitals_json(figures.vitals);
      one["pressure_events"] = events_json(figures.pressure);
      one["pressure_measured"] = figures.measured.judged;
      if (!figures.measured.unread_units.empty())
        one["pressure_units_unread"] = figures.measured.unread_units;
    } else {
      one["done"] = nullptr;
    }
    all.push_back(std::move(one));
  }
  return all;
}

ordered_json map_json(const std::optional<TimeMap>& map) {
  if (!map) return nullptr;
  ordered_json pieces = ordered_json::array();
  for (const MapPiece& piece : map->pieces()) {
    ordered_json knots = ordered_json::array();
    for (const Knot& knot : piece.knots) knots.push_back({knot.plan_s, knot.case_ns});
    pieces.push_back({{"step", piece.step + 1}, {"knots", std::move(knots)}});
  }
  return {{"monotone", map->monotone()}, {"pieces", std::move(pieces)}};
}

ordered_json registration_json(const CameraTrack& track) {
  const Registration& found = track.registration();
  const auto vector = [](const auto& values) {
    ordered_json all = ordered_json::array();
    for (const double value : values) all.push_back(value);
    return all;
  };
  return {{"rms_px", found.rms_px},
          {"error_px", found.error_px},
          {"largest_held_rms_px", track.largest_rms_px()},
          {"field_deg", found.field_deg},
          {"field_estimated", found.field_estimated},
          {"eye_m", vector(found.camera.eye_m)},
          {"view_axes", vector(found.camera.to_view.transpose().reshaped())},
          {"lost_ns", or_null(track.lost_ns())}};
}

ordered_json alignment_json(const sim::Registration& found) {
  constexpr double kMmPerM = 1000, kDegrees = 180 / std::numbers::pi;
  const sim::Vector3 mm = kMmPerM * found.translation_m, degrees = kDegrees * found.rotation_rad;
  return {{"similarity", found.similarity_after},
          {"translation_mm", {mm.x(), mm.y(), mm.z()}},
          {"rotation_deg", {degrees.x(), degrees.y(), degrees.z()}}};
}

ordered_json fluoroscopy_json(const Fluoroscopy& found) {
  return {{"stream", found.stream},
          {"at_ns", found.at_ns},
          {"plan_s", found.plan_s},
          {"polarity", found.polarity == sim::Polarity::kBoneBlack ? "bone-black" : "bone-white"},
          {"geometry", ordered_json::parse(sim::geometry_json(found.geometry))},
          {"similarity", found.similarity},
          {"alignment", found.alignment ? alignment_json(*found.alignment) : ordered_json(nullptr)}};
}

/// Numbers of which a document with thousands of moments needs no seventeen digits. Divided last: a product
/// with 0.01 would have them again.
double rounded(double value, double per_one) { return std::round(value * per_one) / per_one; }

void add_camera(const sim::Camera& camera, ordered_json& into) {
  constexpr double kMicrometre = 1e6, kTurn = 1e7;
  for (const double value : camera.eye_m) into["eye_m"].push_back(rounded(value, kMicrometre));
  for (const double value : camera.to_view.transpose().reshaped())
    into["view_axes"].push_back(rounded(value, kTurn));
}

/// Four nodes a digit, the first the most significant.
std::string hex_of(const std::vector<bool>& nodes) {
  std::string text;
  for (std::size_t from = 0; from < nodes.size(); from += 4) {
    unsigned digit = 0;
    for (std::size_t i = from; i < from + 4; ++i) digit = 2 * digit + (i < nodes.size() && nodes[i] ? 1 : 0);
    text += "0123456789abcdef"[digit];
  }
  return text;
}

ordered_json deformation_json(const Deformation& deformation) {
  constexpr double kMmPerM = 1000, kHundredth = 100;
  ordered_json one{{"since_ns", deformation.rest_ns},
                   {"misfit_px", rounded(deformation.misfit_px, kHundredth)},
                   {"outline_seen", rounded(deformation.supported, kHundredth)},
                   {"standard_error_mm", rounded(kMmPerM * deformation.standard_error_m, kHundredth)},
                   {"largest_mm", rounded(kMmPerM * deformation.largest_m, kHundredth)}};
  add_camera(deformation.camera, one);
  one["weights_mm"] = deformation.weights_mm;
  if (!std::ranges::all_of(deformation.told, std::identity())) one["told"] = hex_of(deformation.told);
  return one;
}

void add_shape(const Deformation& deformation, ordered_json& moment) {
  if (deformation.deformed()) {
    moment["deformed"] = deformation_json(deformation);
    return;
  }
  moment["rigid"] = sim::name_of(deformation.why);
  if (deformation.why == sim::WhyRigid::kUnfitted) moment["unfitted"] = sim::name_of(deformation.unfitted);
}

/// Two nodes a digit of base64's alphabet, three bits each: 0 where a node does not depart, else the seventh
/// of the scale that it lies in.
std::string departures_text(const std::vector<float>& beyond_m, double scale_mm) {
  constexpr unsigned kLevels = 7;
  constexpr double kMmPerM = 1000;
  const auto level = [&](std::size_t node) -> unsigned {
    if (node >= beyond_m.size() || beyond_m[node] <= 0) return 0;
    return static_cast<unsigned>(
        std::clamp(std::ceil(kLevels * kMmPerM * beyond_m[node] / scale_mm), 1.0, double(kLevels)));
  };
  std::string text;
  for (std::size_t node = 0; node < beyond_m.size(); node += 2) {
    text +=
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"[8 * level(node) + level(node + 1)];
  }
  return text;
}

ordered_json departure_json(const Departure& departure, double scale_mm) {
  constexpr double kMmPerM = 1000, kHundredth = 100;
  ordered_json one{{"step", departure.moment->step + 1},
                   {"plan_s", rounded(departure.moment->plan_s, kMmPerM)},
                   {"told", rounded(departure.told, kHundredth)},
                   {"beyond", std::floor(kMmPerM * departure.beyond) / kMmPerM},  // none departs by rounding
                   {"standard_error_mm", rounded(kMmPerM * departure.standard_error_m, kHundredth)}};
  if (departure.largest_m == 0) return one;
  one["largest_mm"] = rounded(kMmPerM * departure.largest_m, kHundredth);
  one["largest_error_mm"] = rounded(kMmPerM * departure.largest_error_m, kHundredth);
  one["nodes"] = departures_text(departure.beyond_m, scale_mm);
  return one;
}

void add_departure(const Departure& departure, double scale_mm, ordered_json& moment) {
  if (departure.compared()) {
    moment["departure"] = departure_json(departure, scale_mm);
  } else if (departure.why != WhyNoDeparture::kNoShape) {
    moment["no_departure"] = name_of(departure.why);
  }
}

ordered_json departures_json(const Alignment& alignment) {
  if (!alignment.deformed || alignment.deformed->departures.empty()) return nullptr;
  constexpr double kMmPerM = 1000, kHundredth = 100;
  const std::vector<Departure>& all = alignment.deformed->departures;
  ordered_json steps = ordered_json::array();
  for (const StepDeparture& step : alignment.step_departures()) {
    ordered_json one{{"step", step.step + 1},
                     {"pictures", step.pictures},
                     {"compared", step.compared},
                     {"departed", step.departed}};
    if (step.departed > 0) {
      one["largest_mm"] = rounded(kMmPerM * step.largest_m, kHundredth);
      one["largest_error_mm"] = rounded(kMmPerM * step.largest_error_m, kHundredth);
      one["at_ns"] = step.at_ns;
    }
    steps.push_back(std::move(one));
  }
  return {{"compared", std::ranges::count_if(all, &Departure::compared)},
          {"departed", std::ranges::count_if(all, &Departure::departed)},
          {"scale_mm", alignment.deformed->departure_scale_mm()},
          {"errors", sim::DeformedTrack::kBeyond},
          {"least_beyond", sim::DeformedTrack::kLeastBeyond},
          {"steps", std::move(steps)}};
}

ordered_json moment_json(const sim::AlignedMoment& moment) {
  constexpr double kMmPerM = 1000, kHundredth = 100;
  ordered_json one{{"time_ns", moment.time_ns},
                   {"misfit_px", rounded(moment.misfit_px, kHundredth)},
                   {"outline_seen", rounded(moment.supported, kHundredth)}};
  if (moment.rival_px > 0) one["rival_px"] = rounded(moment.rival_px, kHundredth);
  if (!moment.held()) {
    one["lost"] = sim::name_of(moment.why);
    return one;
  }
  one["standard_error_mm"] = rounded(kMmPerM * moment.standard_error_m, kHundredth);
  add_camera(moment.camera, one);
  return one;
}

ordered_json deformed_alignment_json(const DeformedAlignment& deformed) {
  constexpr double kMmPerM = 1000, kHundredth = 100;
  ordered_json fields = ordered_json::array();
  for (const Eigen::VectorXd& field : deformed.fields.fields()) {
    ordered_json one = ordered_json::array();
    for (const double value : field) one.push_back(value);
    fields.push_back(std::move(one));
  }
  return {{"pictures", deformed.deformed()},
          {"largest_mm", rounded(kMmPerM * deformed.largest_m(), kHundredth)},
          {"scale_mm", deformed.scale_mm()},
          {"field_error_mm", DisplacementFields::kMostErrorMm},
          {"fields", std::move(fields)}};
}

ordered_json surface_json(const sim::DrawnSurface& surface) {
  constexpr double kMmPerM = 1000, kHundredth = 100;
  ordered_json nodes = ordered_json::array(), faces = ordered_json::array();
  for (const sim::Vector3& node : surface.nodes) {
    for (const double value : node) nodes.push_back(rounded(kMmPerM * value, kHundredth));
  }
  for (const auto& face : surface.faces) {
    for (const std::uint32_t node : face) faces.push_back(node);
  }
  return {{"moved_mm", rounded(kMmPerM * surface.moved_m, kHundredth)},
          {"nodes_mm", std::move(nodes)},
          {"faces", std::move(faces)}};
}

ordered_json lens_json(const UsedLens& used) {
  const sim::LensCalibration& lens = used.lens.calibration();
  return {{"file", file_json(used.file)},
          {"model", sim::name_of(lens.model)},
          {"width", lens.width},
          {"height", lens.height},
          {"focal_px", {lens.focal_px.x(), lens.focal_px.y()}},
          {"middle_px", {lens.middle_px.x(), lens.middle_px.y()}},
          {"coefficients", lens.coefficients},
          {"reach", used.lens.reach()}};
}

ordered_json organ_alignment_json(const Alignment& alignment) {
  ordered_json lost = ordered_json::array(), moments = ordered_json::array(), sizes = ordered_json::array();
  for (const Alignment::Lost& each : alignment.lost()) {
    ordered_json one = span_json(each.span);
    one["why"] = sim::name_of(each.why);
    lost.push_back(std::move(one));
  }
  for (const Alignment::PictureSize& size : alignment.sizes)
    sizes.push_back({{"from_ns", size.from_ns}, {"width", size.width}, {"height", size.height}});
  const double departures_mm = alignment.deformed ? alignment.deformed->departure_scale_mm() : 0;
  for (std::size_t i = 0; i < alignment.moments.size(); ++i) {
    moments.push_back(moment_json(alignment.moments[i]));
    if (!alignment.deformed) continue;
    add_shape(alignment.deformed->moments[i], moments.back());
    if (i < alignment.deformed->departures.size())
      add_departure(alignment.deformed->departures[i], departures_mm, moments.back());
  }
  ordered_json all = span_json(alignment.span);
  all["field_deg"] = alignment.field_deg;
  if (alignment.lens) all["lens"] = lens_json(*alignment.lens);
  all["pictures"] = alignment.moments.size();
  all["held"] = alignment.held();
  all["lost"] = std::move(lost);
  all["picture_sizes"] = std::move(sizes);
  all["surface"] = surface_json(alignment.surface);
  all["deformed"] = alignment.deformed ? deformed_alignment_json(*alignment.deformed) : ordered_json(nullptr);
  all["departure"] = departures_json(alignment);
  all["moments"] = std::move(moments);
  return all;
}

ordered_json distance_json(const Distance& distance) {
  return {
      {"pictures", distance.pictures}, {"mean_px", distance.mean_px}, {"largest_px", distance.largest_px}};
}

ordered_json tools_json(const Comparison& comparison, const sim::Plan& plan) {
  ordered_json all = ordered_json::array();
  for (const ToolDistance& tool : comparison.tools) {
    ordered_json one{{"tool", plan.tools[tool.tool].tool.name}};
    one.update(distance_json(tool.all));
    one["largest_drift_px"] = tool.largest_drift_px;
    one["lost"] = ordered_json::array();
    for (const archive::Span& span : tool.lost) one["lost"].push_back(span_json(span));
    one["steps"] = ordered_json::array();
    for (std::size_t step = 0; step < tool.of_steps.size(); ++step) {
      if (tool.of_steps[step].pictures == 0) continue;
      ordered_json of_step{{"step", step + 1}};
      of_step.update(distance_json(tool.of_steps[step]));
      one["steps"].push_back(std::move(of_step));
    }
    all.push_back(std::move(one));
  }
  return all;
}

}  // namespace

std::string comparison_json(const Comparison& comparison, const sim::Plan& plan, const Provenance& made) {
  ordered_json document = provenance_json(made, comparison.stream);
  document["in_planned_order"] = comparison.matching.in_planned_order();
  document["steps"] = steps_json(comparison);
  document["repeated_marks"] = marks_json(comparison.matching.repeated);
  document["events_lacking"] = comparison.record.events_lacking;
  document["ambiguous_marks"] = marks_json(comparison.matching.ambiguous);
  document["other_marks"] = marks_json(comparison.matching.unmatched);
  document["time_map"] = map_json(comparison.map);
  document["vital_window_ns"] = kVitalWindowNs;
  const LeftOut& left_out = comparison.record.left_out;
  document["vitals_left_out"] = {
      {"questionable", left_out.questionable}, {"invalid", left_out.invalid}, {"alarms", left_out.alarms}};
  document["pressure_limits_mmhg"] = {{"systolic_low", comparison.limits.systolic_low},
                                      {"systolic_high", comparison.limits.systolic_high},
                                      {"mean_low", comparison.limits.mean_low}};
  document["registration"] =
      comparison.camera ? registration_json(*comparison.camera) : ordered_json(nullptr);
  document["tools"] = tools_json(comparison, plan);
  document["fluoroscopy"] =
      comparison.fluoroscopy ? fluoroscopy_json(*comparison.fluoroscopy) : ordered_json(nullptr);
  document["organ_alignment"] =
      comparison.alignment ? organ_alignment_json(*comparison.alignment) : ordered_json(nullptr);
  document["outputs"] = files_json(made.outputs);
  return document_text(document);
}

}  // namespace kiroku::compare

#include "viewer/breathing/breathing_messages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/foreign_json.h"
#include "sim/render/picture_jpeg.h"
#include "viewer/http/message_fields.h"
#include "viewer/http/picture_message.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr int kQuality = 90;
constexpr double kMmPerM = 1000, kSecondsPerMinute = 60, kLongestS = 1e6;
constexpr double kMostMm = kMmPerM * sim::kLargestAmplitudeM;
constexpr std::array<std::pair<const char*, sim::OverlayMode>, 6> kModes{
    {{"opacity", sim::OverlayMode::kOpacity},
     {"wipe", sim::OverlayMode::kWipe},
     {"difference", sim::OverlayMode::kDifference},
     {"contour", sim::OverlayMode::kContour},
     {"checkerboard", sim::OverlayMode::kCheckerboard},
     {"beside", sim::OverlayMode::kBeside}}};

std::optional<sim::Vector3> direction_of(const json& group) {
  const json& said = message_field(group, "direction");
  if (said.is_null()) return std::nullopt;
  const bool is_vector = said.is_array() && said.size() == 3 &&
                         std::ranges::all_of(said, [](const json& one) { return one.is_number(); });
  if (!is_vector) throw Refusal(400, "'direction' must be null, for the normals, or [x, y, z]");
  const sim::Vector3 direction(said[0].get<double>(), said[1].get<double>(), said[2].get<double>());
  if (!direction.allFinite() || !(direction.norm() > 0))
    throw Refusal(400, "'direction' is [0, 0, 0] or no number, which is no direction");
  return direction.normalized();
}

sim::GroupMotion group_of(const json& motion, const char* name) {
  const json& group = message_field(motion, name);
  return {message_number(group, "amplitude_mm", -kMostMm, kMostMm) / kMmPerM,
          message_number(group, "phase_s", -sim::kLongestPhaseS, sim::kLongestPhaseS), direction_of(group),
          message_number(group, "baseline_mm", -kMostMm, kMostMm) / kMmPerM,
          message_number(group, "drift_mm_per_min", -kMostMm, kMostMm) / kMmPerM / kSecondsPerMinute};
}

/// A figure for each node of the surface, as boundary_group has them in frames: "1" is free.
std::optional<sim::BoundaryGroups> surface_groups_of(const json& motion) {
  const json& said = message_field(motion, "groups");
  if (said.is_null()) return std::nullopt;
  const std::string figures = message_text(motion, "groups");
  sim::BoundaryGroups groups;
  groups.reserve(figures.size());
  for (const char figure : figures) {
    if (figure <= '0' || figure >= static_cast<char>('0' + sim::kBoundaryGroups))
      throw Refusal(400, "'groups' must be null, or a figure from 1 to 5 for each node of the surface");
    groups.push_back(static_cast<sim::BoundaryGroup>(figure - '0'));
  }
  return groups;
}

std::string figures_of(const sim::BoundaryGroups& groups) {
  std::string figures;
  for (const sim::BoundaryGroup group : groups)
    figures.push_back(static_cast<char>('0' + static_cast<int>(group)));
  return figures;
}

MotionDeed motion_of(const json& said) {
  MotionDeed deed{{group_of(said, "rib_cage"), group_of(said, "diaphragm")}, std::nullopt};
  if (!message_field(said, "cycle_s").is_null())
    deed.cycle_s =
        message_number(said, "cycle_s", 2 * sim::Waveform::kShortestBreathS, sim::Waveform::kLongestS);
  deed.surface_groups = surface_groups_of(said);
  return deed;
}

LookDeed look_of(const json& said) {
  const std::string name = message_text(said, "mode");
  const auto* const mode = std::ranges::find_if(kModes, [&](const auto& one) { return name == one.first; });
  if (mode == kModes.end())
    throw Refusal(400,
                  "'mode' must be 'opacity', 'wipe', 'difference', 'contour', 'checkerboard' or 'beside'");
  return {mode->second, message_number(said, "part", 0, 1), message_flag(said, "outlined")};
}

ordered_json vector_json(const sim::Vector3& v) { return {v.x(), v.y(), v.z()}; }

ordered_json group_json(const sim::GroupMotion& group) {
  return {{"amplitude_mm", kMmPerM * group.amplitude_m},
          {"phase_s", group.phase_s},
          {"direction", group.direction ? vector_json(*group.direction) : ordered_json(nullptr)},
          {"baseline_mm", kMmPerM * group.baseline_m},
          {"drift_mm_per_min", kMmPerM * kSecondsPerMinute * group.drift_m_per_s}};
}

ordered_json recording_json(const std::optional<BenchRecording>& recording) {
  if (!recording) return nullptr;
  return {{"case", recording->case_id}, {"stream", recording->stream}, {"first_s", recording->first_s}};
}

/// What a group's numbers may be off by, and what of the motion they explain.
ordered_json errors_json(const sim::WaveFit& wave) {
  return {{"amplitude_mm", kMmPerM * wave.amplitude_error_m},
          {"phase_s", wave.phase_error_s},
          {"baseline_mm", kMmPerM * wave.baseline_error_m},
          {"drift_mm_per_min", kMmPerM * kSecondsPerMinute * wave.drift_error_m_per_s},
          {"explained", wave.explained}};
}

sim::Picture plain(const sim::ColourPicture& picture) {
  sim::Picture out(static_cast<int>(picture.columns), static_cast<int>(picture.rows));
  std::memcpy(out.rgb.data(), picture.pixels.data(), out.rgb.size());
  return out;
}

}  // namespace

BreathingMessage parse_breathing_message(std::string_view text) {
  const json object = parse_foreign_json(text);
  if (!object.is_object()) throw Refusal(400, "a message must be a JSON object");
  const std::uint64_t input = message_count(object, "input");
  if (object.contains("motion")) return {input, motion_of(object["motion"])};
  if (object.contains("moment"))
    return {input, MomentDeed{message_number(object["moment"], "time_s", -kLongestS, kLongestS)}};
  if (object.contains("look")) return {input, look_of(object["look"])};
  if (object.contains("save")) {
    const json& save = object["save"];
    return {input, SaveMotion{message_text(save, "file"), motion_of(message_field(save, "motion")),
                              message_flag(save, "seal")}};
  }
  if (object.contains("fit")) {
    const json& fit = object["fit"];
    return {input, FitDeed{motion_of(message_field(fit, "motion")), message_flag(fit, "direction")}};
  }
  if (object.contains("cancel")) return {input, CancelFit{}};
  throw Refusal(400, "a message must have 'motion', 'moment', 'look', 'save', 'fit' or 'cancel'");
}

ordered_json motion_json(const MotionDeed& motion) {
  return {{"rib_cage", group_json(motion.motion.rib_cage)},
          {"diaphragm", group_json(motion.motion.diaphragm)},
          {"cycle_s", motion.cycle_s ? ordered_json(*motion.cycle_s) : ordered_json(nullptr)},
          {"groups",
           motion.surface_groups ? ordered_json(figures_of(*motion.surface_groups)) : ordered_json(nullptr)}};
}

ordered_json opened_json(const BreathingBench& bench, bool may_seal) {
  ordered_json groups = ordered_json::object();
  const auto counts = sim::counts_of(bench.model().groups);
  for (std::size_t group = 1; group < counts.size(); ++group)
    groups[sim::name_of(static_cast<sim::BoundaryGroup>(group))] = counts[group];
  return {{"opened",
           {{"file", bench.file().filename().string()},
            {"vertices", bench.nodes()},
            {"groups", groups},
            {"columns", bench.geometry(1).columns()},
            {"rows", bench.geometry(1).rows()},
            {"radiographs", bench.radiographs().size()},
            {"recording", recording_json(bench.recording())},
            {"can_fit", bench.can_fit()},
            {"may_seal", may_seal},
            {"warnings", bench.model().warnings},
            {"motion", motion_json(bench.own_motion())}}}};
}

ordered_json surface_json(const BreathingBench& bench) {
  if (!bench.may_paint()) return {{"surface", nullptr}};
  constexpr double kPerMm = 100;  // nobody sees more than hundredths
  const sim::LungSurface& surface = bench.surface();
  ordered_json nodes_mm = ordered_json::array(), faces = ordered_json::array();
  sim::BoundaryGroups groups;
  for (const std::uint32_t node : surface.nodes) {
    for (const double coordinate_m : bench.model().mesh.nodes[node])
      nodes_mm.push_back(std::round(coordinate_m * kMmPerM * kPerMm) / kPerMm);
    groups.push_back(bench.model().groups[node]);
  }
  for (const auto& face : surface.faces) {
    for (const std::uint32_t node : face) faces.push_back(node);
  }
  return {{"surface",
           {{"nodes_mm", std::move(nodes_mm)}, {"faces", std::move(faces)}, {"groups", figures_of(groups)}}}};
}

ordered_json refused_json(const std::string& why, std::uint64_t input, const MotionDeed& stands) {
  return {{"refused", {{"input", input}, {"why", why}, {"motion", motion_json(stands)}}}};
}

ordered_json path_json(const BreathingTable& table) {
  const sim::TumourPath path = table.path();
  ordered_json places = ordered_json::array();
  for (const sim::Vector3& centre_m : path.centres_m)
    places.push_back(vector_json(kMmPerM * (centre_m - path.rest_m)));
  return {{"path",
           {{"revision", table.revision()},
            {"duration_s", table.duration_s()},
            {"times_s", path.times_s},
            {"mm", std::move(places)}}}};
}

ordered_json similarity_json(const BreathingTable& table) {
  ordered_json values = ordered_json::array();
  for (const std::optional<double>& one : table.similarities())
    values.push_back(one ? ordered_json(*one) : ordered_json(nullptr));
  return {{"similarity", {{"revision", table.revision()}, {"values", std::move(values)}}}};
}

ordered_json fitting_json(const std::string& doing, std::size_t done, std::size_t all) {
  return {{"fitting", {{"doing", doing}, {"done", done}, {"all", all}}}};
}

ordered_json fitted_json(const FittedSeries& fitted) {
  const sim::SeriesFit& fit = fitted.fit;
  const bool found = fit.refusal.empty();
  ordered_json tumour = ordered_json::array();
  for (const std::optional<SeenTumour>& one : fitted.tumour) {
    tumour.push_back(one ? ordered_json{{"mm", vector_json(kMmPerM * one->place_m)},
                                        {"error_mm", vector_json(kMmPerM * one->error_m)}}
                         : ordered_json(nullptr));
  }
  return {{"fitted",
           {{"refusal", found ? ordered_json(nullptr) : ordered_json(fit.refusal)},
            {"motion", found ? motion_json(fitted.motion) : ordered_json(nullptr)},
            {"errors", found ? ordered_json{{"rib_cage", errors_json(fit.rib_cage)},
                                            {"diaphragm", errors_json(fit.diaphragm)},
                                            {"cycle_s", fit.cycle ? ordered_json(fit.cycle->error_s)
                                                                  : ordered_json(nullptr)}}
                             : ordered_json(nullptr)},
            {"similarity", {{"before", fit.similarity_before}, {"after", fit.similarity_after}}},
            {"change", fit.change},
            {"change_by_chance", fit.change_by_chance},
            {"findings", fit.findings},
            {"took_s", fitted.took.count()},
            {"tumour", std::move(tumour)}}}};
}

Bytes moment_message(const BreathingMoment& moment) {
  const BreathingTable::Shown& shown = *moment.shown;
  return picture_message(
      {{"picture", moment.number},
       {"input", moment.input},
       {"revision", moment.revision},
       {"time_s", shown.time_s},
       {"radiograph", shown.radiograph ? ordered_json(*shown.radiograph) : ordered_json(nullptr)},
       {"tumour_mm", vector_json(kMmPerM * shown.tumour_m)},
       {"drawing_ms", static_cast<double>(moment.drawing.count()) / 1e6}},
      sim::jpeg_of(plain(shown.picture), kQuality));
}

}  // namespace kiroku::viewer

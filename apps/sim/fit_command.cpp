// 'kiroku sim fit': how a patient's own lung breathes, from radiographs or from a second CT.
#include <filesystem>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "apps/sim/frame_series.h"
#include "apps/sim/sim_command.h"
#include "base/error.h"
#include "sim/fem/number_text.h"
#include "sim/mesh/mesh_writer.h"
#include "sim/model/body_model.h"
#include "sim/respiration/motion_fit.h"
#include "sim/respiration/shape_fit.h"
#include "sim/volume/volume_reader.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using sim::number_text;

struct FitRequest {
  std::string model, output;
  std::optional<std::string> positions, shape, displacement;
  std::vector<std::string> geometries, landmarks;
  bool directions = false, json = false;
};

constexpr double kMillimetres = 1000;

std::string observer_text() {
  return "people find the same point twice to " + number_text(sim::kObserverMm) + " +/- " +
         number_text(sim::kObserverSpreadMm) + " mm";
}

nlohmann::ordered_json spread_json(const sim::Spread& spread) {
  return {{"count", spread.count},
          {"mean_mm", kMillimetres * spread.mean},
          {"deviation_mm", kMillimetres * spread.deviation},
          {"median_mm", kMillimetres * spread.median},
          {"percentile_95_mm", kMillimetres * spread.percentile_95},
          {"greatest_mm", kMillimetres * spread.greatest}};
}

nlohmann::ordered_json motion_json(const sim::GroupMotion& motion) {
  nlohmann::ordered_json object{{"amplitude_mm", kMillimetres * motion.amplitude_m},
                                {"phase_s", motion.phase_s}};
  if (motion.direction)
    object["direction"] = {motion.direction->x(), motion.direction->y(), motion.direction->z()};
  return object;
}

std::string motion_text(const sim::GroupMotion& motion, double error_m, double error_s, bool phase) {
  std::string text = number_text(kMillimetres * motion.amplitude_m, 4);
  if (error_m > 0) text += " +/- " + number_text(kMillimetres * error_m, 2);
  text += " mm";
  if (motion.direction) {
    text += " along (" + number_text(motion.direction->x(), 3) + ", " +
            number_text(motion.direction->y(), 3) + ", " + number_text(motion.direction->z(), 3) + ")";
  }
  if (!phase) return text;
  text += ", phase " + number_text(motion.phase_s, 4);
  if (error_s > 0) text += " +/- " + number_text(error_s, 2);
  return text + " s";
}

std::string mean_text(const sim::Spread& spread) {
  return number_text(kMillimetres * spread.mean, 3) + " +/- " +
         number_text(kMillimetres * spread.deviation, 3);
}

void write_model(const FitRequest& request, const sim::BreathingMotion& motion) {
  const fs::path output = request.output;
  write_text_file(output, sim::with_motion(request.model, motion, fs::absolute(output).parent_path()));
}

int fit_to_radiographs(const FitRequest& request, const sim::BreathingModel& model) {
  if (request.geometries.empty())
    throw UsageError(
        "--positions needs --geometry: how source and detector saw the patient, once for each view");
  std::vector<sim::ProjectionGeometry> views;
  for (const std::string& file : request.geometries) views.push_back(sim::read_geometry(file).geometry);
  const auto positions =
      sim::parse_positions(sim::read_document(*request.positions), *request.positions, views.size());
  const sim::MotionFitResult found = sim::fit_motion(model, views, positions, {request.directions});
  write_model(request, found.motion);
  if (request.json) {
    print_json({{"file", request.output},
                {"fitted_on", *request.positions},
                {"positions", positions.size()},
                {"views", views.size()},
                {"rib_cage", motion_json(found.motion.rib_cage)},
                {"diaphragm", motion_json(found.motion.diaphragm)},
                {"standard_errors",
                 {{"rib_cage_mm", kMillimetres * found.rib_cage_m},
                  {"rib_cage_s", found.rib_cage_s},
                  {"diaphragm_mm", kMillimetres * found.diaphragm_m},
                  {"diaphragm_s", found.diaphragm_s}}},
                {"mean_residual_before_mm", kMillimetres * found.before_m},
                {"residual", spread_json(found.residual_m)},
                {"observer_mm", {sim::kObserverMm, sim::kObserverSpreadMm}},
                {"warnings", model.warnings}});
    return kDone;
  }
  std::cout << request.output << ": fitted on " << positions.size() << " positions of the tumour in "
            << views.size() << (views.size() == 1 ? " view" : " views") << " ("
            << printable(*request.positions) << ")\n"
            << "  rib cage   " << motion_text(found.motion.rib_cage, found.rib_cage_m, found.rib_cage_s, true)
            << "\n"
            << "  diaphragm  "
            << motion_text(found.motion.diaphragm, found.diaphragm_m, found.diaphragm_s, true)
            << "\n  left at the tumour's depth: " << mean_text(found.residual_m) << " mm, at most "
            << number_text(kMillimetres * found.residual_m.greatest, 3) << " mm; "
            << number_text(kMillimetres * found.before_m, 3) << " mm with the model's own motion; "
            << observer_text() << "\n";
  return kDone;
}

void print_shape(const FitRequest& request, const sim::ShapeFitResult& found,
                 const std::optional<sim::LandmarkErrors>& errors) {
  std::cout << request.output << ": fitted on the surface in " << printable(*request.shape) << " ("
            << number_text(1e6 * found.second_volume_m3, 4) << " ml; the lung at rest has "
            << number_text(1e6 * found.first_volume_m3, 4) << " ml)\n"
            << "  rib cage   " << motion_text(found.motion.rib_cage, 0, 0, false) << "\n  diaphragm  "
            << motion_text(found.motion.diaphragm, 0, 0, false) << "\n";
  std::vector<std::vector<std::string>> rows{{"", "to the surface, mm", "95 %", "volume, ml", "inside out"}};
  if (errors) rows.front().insert(rows.front().end(), {"at landmarks, mm", "95 %"});
  if (errors) {
    const sim::Spread before = sim::spread_of(errors->before_m);
    rows.push_back({"as they lie", "", "", "", "", mean_text(before),
                    number_text(kMillimetres * before.percentile_95, 3)});
  }
  for (std::size_t i = 0; i < found.steps.size(); ++i) {
    const sim::ShapeFitStep& step = found.steps[i];
    rows.push_back({step.name, mean_text(step.surface_m),
                    number_text(kMillimetres * step.surface_m.percentile_95, 3),
                    number_text(1e6 * step.volume_m3, 4), std::to_string(step.inverted)});
    if (!errors) continue;
    const sim::Spread left = sim::spread_of(errors->of_step_m[i]);
    rows.back().insert(rows.back().end(),
                       {mean_text(left), number_text(kMillimetres * left.percentile_95, 3)});
  }
  std::cout << format_table(rows, errors ? "lrrrrrr" : "lrrrr", 2);
  if (!errors) return;
  std::cout << "  " << errors->before_m.size() << " landmarks, on which nothing was fitted; "
            << observer_text();
  if (errors->outside > 0) {
    std::cout << "; " << errors->outside << " others lie more than "
              << number_text(kMillimetres * sim::kLandmarkReachM) << " mm outside the lung";
  }
  std::cout << "\n";
}

int fit_to_shape(const FitRequest& request, const sim::BreathingModel& model) {
  std::optional<sim::LandmarkPairs> landmarks;
  if (!request.landmarks.empty())
    landmarks = sim::read_landmark_pairs(request.landmarks[0], request.landmarks[1]);
  const sim::LabelMap second = sim::read_label_map(*request.shape);
  const sim::ShapeFitResult found = [&] {
    StepLine line;
    return sim::fit_shape(model, second, {request.directions},
                          [&](const std::string& step) { line.show(step); });
  }();
  std::optional<sim::LandmarkErrors> errors;
  if (landmarks) {
    errors = sim::errors_at(*landmarks, model.mesh, found.steps);
    if (errors->before_m.empty())
      throw Error("no landmark of " + request.landmarks[0] +
                  " is in the lung: are they in its patient coordinates, mm?");
  }
  write_model(request, found.motion);
  if (request.displacement) {
    // Where the sliding boundary takes each node, in the second CT.
    const sim::ShapeFitStep& last = found.steps.back();
    std::vector<double> moved;
    for (std::size_t node = 0; node < model.mesh.nodes.size(); ++node) {
      const sim::Vector3 place_m =
          model.mesh.nodes[node] + last.displacement_m.segment<3>(static_cast<Eigen::Index>(3 * node));
      const sim::Vector3 by =
          (last.placement * place_m - model.mesh.nodes[node]) * sim::units_per_metre(model.unit);
      moved.insert(moved.end(), by.begin(), by.end());
    }
    write_text_file(*request.displacement,
                    sim::vtu_text(model.mesh, model.unit, {{"displacement", {"X", "Y", "Z"}, moved}}, {}));
  }
  if (!request.json) {
    print_shape(request, found, errors);
    return kDone;
  }
  nlohmann::ordered_json steps = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < found.steps.size(); ++i) {
    const sim::ShapeFitStep& step = found.steps[i];
    steps.push_back({{"step", step.name},
                     {"surface", spread_json(step.surface_m)},
                     {"volume_ml", 1e6 * step.volume_m3},
                     {"inside_out", step.inverted}});
    if (errors) steps.back()["landmarks"] = spread_json(sim::spread_of(errors->of_step_m[i]));
  }
  nlohmann::ordered_json object{{"file", request.output},
                                {"fitted_on", *request.shape},
                                {"rib_cage", motion_json(found.motion.rib_cage)},
                                {"diaphragm", motion_json(found.motion.diaphragm)},
                                {"first_volume_ml", 1e6 * found.first_volume_m3},
                                {"second_volume_ml", 1e6 * found.second_volume_m3},
                                {"steps", steps}};
  if (errors) {
    object["landmarks_before"] = spread_json(sim::spread_of(errors->before_m));
    object["landmarks_outside"] = errors->outside;
  }
  object["observer_mm"] = {sim::kObserverMm, sim::kObserverSpreadMm};
  object["warnings"] = model.warnings;
  print_json(object);
  return kDone;
}

int run(const FitRequest& request) {
  if (request.positions.has_value() == request.shape.has_value())
    throw UsageError(
        "say what to fit to: --positions (radiographs) or --shape (a second CT's mask), one of them");
  if (request.positions && (!request.landmarks.empty() || request.displacement))
    throw UsageError("--landmarks and --displacement belong to --shape");
  if (request.shape && !request.geometries.empty()) throw UsageError("--geometry belongs to --positions");
  const sim::BreathingModel model = sim::read_breathing_model(request.model);
  if (!request.json) {
    for (const std::string& warning : model.warnings) print_error("kiroku", "warning: " + warning);
  }
  return request.positions ? fit_to_radiographs(request, model) : fit_to_shape(request, model);
}

}  // namespace

void add_sim_fit_command(Command& sim) {
  Command& command =
      sim.add_command("fit", "finds how a patient's lung breathes, from radiographs or a second CT");
  const auto request = std::make_shared<FitRequest>();
  command.argument("MODEL", request->model, "the breathing lung (.json), as for sim respire");
  command.option("--positions", "CSV", request->positions,
                 "where the tumour is on radiographs: time_s,view,column,row");
  command.option("--geometry", "FILE", request->geometries,
                 "of each view, in the order they are counted in from 1");
  command.option("--shape", "MASK", request->shape, "a second shape of the same lung (.mha, .nii.gz, ...)");
  command.pair_option("--landmarks", "FIXED MOVING", request->landmarks,
                      "with --shape: points of both CTs, mm, to tell the error at");
  command.option("--displacement", "FILE", request->displacement,
                 "with --shape: where each node goes (.vtu), by the sliding boundary");
  command.flag(
      "--directions", request->directions,
      "seeks directions too: of the diaphragm (two views; the rib cage stays as it is), of both groups "
      "(--shape)");
  command.required_option("-o,--output", "FILE", request->output,
                          "the model with the motion that was found (.json)");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "From radiographs: amplitude and phase of rib cage and diaphragm, by least squares on the detectors. "
      "What the "
      "positions do not determine is refused. From a second shape: the rigid motion between the two CTs, "
      "then the "
      "amplitudes, then a boundary that is brought to the second surface and slides along it; each step's "
      "distance "
      "to the surface, and with landmarks its error there, is told beside what people themselves reach.");
  command.example(
      "kiroku sim fit lung.json --positions seen.csv --geometry front.json --geometry side.json -o "
      "fitted.json",
      "from two views");
  command.example(
      "kiroku sim fit lung.json --shape inhale.mha --landmarks exhale.txt inhale.txt -o fitted.json",
      "from a second CT's mask, with the error at landmarks");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

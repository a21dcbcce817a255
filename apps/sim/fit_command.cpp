// 'kiroku sim fit': how a patient's own lung breathes, from radiographs or from a second CT.
#include <filesystem>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "apps/sim/frame_series.h"
#include "apps/sim/number_option.h"
#include "apps/sim/sim_command.h"
#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/mesh_writer.h"
#include "sim/model/body_model.h"
#include "sim/respiration/landmark_analysis.h"
#include "sim/respiration/motion_fit.h"
#include "sim/respiration/shape_fit.h"
#include "sim/volume/volume_reader.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

struct FitRequest {
  std::string model, output;
  std::optional<std::string> positions, shape, displacement, errors, poisson_ratio;
  std::vector<std::string> geometries, landmarks, correspondences;
  bool directions = false, cross_validate = false, json = false;
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

void write_model(const FitRequest& request, const sim::BreathingModel& model,
                 const sim::BreathingMotion& motion) {
  const fs::path output = request.output;
  write_text_file(output, sim::with_motion(model, request.model, motion, fs::absolute(output).parent_path()));
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
  write_model(request, model, found.motion);
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
  std::cout << printable(request.output) << ": fitted on " << positions.size()
            << " positions of the tumour in " << views.size() << (views.size() == 1 ? " view" : " views")
            << " (" << printable(*request.positions) << ")\n"
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
  std::cout << (found.refusal.empty() ? printable(request.output) + ": fitted on the surface in "
                                      : "nothing written: tried on the surface in ")
            << printable(*request.shape) << " (" << number_text(1e6 * found.second_volume_m3, 4)
            << " ml; the lung at rest has " << number_text(1e6 * found.first_volume_m3, 4) << " ml)\n"
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
  if (found.left_out_m) {
    std::cout << "  the second surface where it was left out of the fit, a quarter at a time: "
              << mean_text(*found.left_out_m) << " mm from the lung (median "
              << number_text(kMillimetres * found.left_out_m->median, 3) << ", 95 % below "
              << number_text(kMillimetres * found.left_out_m->percentile_95, 3) << ")\n";
  }
  if (found.correspondences) {
    const sim::CorrespondenceUse& use = *found.correspondences;
    std::cout << "  " << use.given << " correspondences: " << use.left_m.count << " agree, to "
              << mean_text(use.left_m) << " mm; " << use.refused << " do not and hardly count";
    if (use.outside > 0) {
      std::cout << "; " << use.outside << " lie more than "
                << number_text(kMillimetres * sim::kCorrespondenceReachM) << " mm outside the lung";
    }
    std::cout << "\n";
  }
  if (!errors) return;
  std::cout << "  " << errors->before_m.size() << " landmarks, on which nothing was fitted; "
            << observer_text();
  if (errors->outside > 0) {
    std::cout << "; " << errors->outside << " others lie more than "
              << number_text(kMillimetres * sim::kLandmarkReachM) << " mm outside the lung";
  }
  std::cout << "\n";
}

/// Where the error of the last step lies, and what landmarks themselves would leave.
void print_decomposition(const sim::LandmarkErrors& errors, const std::string& step) {
  const sim::LandmarkDecomposition parts = sim::decompose(errors, errors.of_step_m.size() - 1);
  const sim::Vector3 mean_mm = kMillimetres * parts.mean_m;
  std::vector<std::vector<std::string>> rows{{step + ", mm", "mean", "95 %"}};
  const auto add = [&](const std::string& name, const sim::Spread& spread) {
    rows.push_back({name, mean_text(spread), number_text(kMillimetres * spread.percentile_95, 3)});
  };
  add("whole", sim::spread_of(errors.of_step_m.back()));
  add("without its mean of (" + number_text(mean_mm.x(), 2) + ", " + number_text(mean_mm.y(), 2) + ", " +
          number_text(mean_mm.z(), 2) + ")",
      parts.without_mean_m);
  add("along the nearest surface's normal", parts.along_normal_m);
  add("across it", parts.across_m);
  for (const auto& part : parts.by_height) add(part.name, part.spread_m);
  for (const auto& part : parts.by_depth) add(part.name, part.spread_m);
  std::cout << format_table(rows, "lrr", 2);
  rows = {{"fitted on the landmarks themselves, mm", "there", "each by the others", "95 %"}};
  for (const sim::LandmarkBound& bound : sim::landmark_bounds(errors.inside)) {
    constexpr double kRoundingM = 1e-9;
    rows.push_back({bound.name, bound.fitted_m.greatest < kRoundingM ? "0" : mean_text(bound.fitted_m),
                    mean_text(bound.left_out_m),
                    number_text(kMillimetres * bound.left_out_m.percentile_95, 3)});
  }
  if (rows.size() > 1) std::cout << format_table(rows, "lrrr", 2);
}

nlohmann::ordered_json decomposition_json(const sim::LandmarkErrors& errors) {
  const sim::LandmarkDecomposition parts = sim::decompose(errors, errors.of_step_m.size() - 1);
  const sim::Vector3 mean_mm = kMillimetres * parts.mean_m;
  nlohmann::ordered_json object{{"mean_mm", {mean_mm.x(), mean_mm.y(), mean_mm.z()}},
                                {"without_mean", spread_json(parts.without_mean_m)},
                                {"along_normal", spread_json(parts.along_normal_m)},
                                {"across", spread_json(parts.across_m)}};
  for (const auto* groups : {&parts.by_height, &parts.by_depth}) {
    for (const auto& part : *groups) object[part.name] = spread_json(part.spread_m);
  }
  nlohmann::ordered_json bounds = nlohmann::ordered_json::array();
  for (const sim::LandmarkBound& bound : sim::landmark_bounds(errors.inside)) {
    bounds.push_back({{"transform", bound.name},
                      {"fitted", spread_json(bound.fitted_m)},
                      {"each_by_the_others", spread_json(bound.left_out_m)}});
  }
  object["landmarks_allow"] = bounds;
  return object;
}

nlohmann::ordered_json shape_json(const FitRequest& request, const sim::BreathingModel& model,
                                  const sim::ShapeFitResult& found,
                                  const std::optional<sim::LandmarkErrors>& errors) {
  nlohmann::ordered_json steps = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < found.steps.size(); ++i) {
    const sim::ShapeFitStep& step = found.steps[i];
    steps.push_back({{"step", step.name},
                     {"surface", spread_json(step.surface_m)},
                     {"volume_ml", 1e6 * step.volume_m3},
                     {"inside_out", step.inverted}});
    if (errors) steps.back()["landmarks"] = spread_json(sim::spread_of(errors->of_step_m[i]));
  }
  nlohmann::ordered_json object;
  if (found.refusal.empty()) {
    object["file"] = request.output;
  } else {
    object["refused"] = found.refusal;
  }
  object["fitted_on"] = *request.shape;
  object["rib_cage"] = motion_json(found.motion.rib_cage);
  object["diaphragm"] = motion_json(found.motion.diaphragm);
  object["first_volume_ml"] = 1e6 * found.first_volume_m3;
  object["second_volume_ml"] = 1e6 * found.second_volume_m3;
  object["steps"] = steps;
  object["second_surface"] = spread_json(found.second_surface_m);
  if (found.correspondences) {
    const sim::CorrespondenceUse& use = *found.correspondences;
    object["correspondences"] = {{"given", use.given},
                                 {"outside", use.outside},
                                 {"disagree", use.refused},
                                 {"left", spread_json(use.left_m)}};
  }
  if (found.left_out_m) object["surface_left_out"] = spread_json(*found.left_out_m);
  if (errors) {
    object["landmarks_before"] = spread_json(sim::spread_of(errors->before_m));
    object["landmarks_outside"] = errors->outside;
    if (request.errors) object["decomposition"] = decomposition_json(*errors);
  }
  object["observer_mm"] = {sim::kObserverMm, sim::kObserverSpreadMm};
  std::vector<std::string> warnings = model.warnings;
  warnings.insert(warnings.end(), found.warnings.begin(), found.warnings.end());
  object["warnings"] = warnings;
  return object;
}

/// Where the last step takes each node, in the second CT.
void write_displacement(const fs::path& file, const sim::BreathingModel& model,
                        const sim::ShapeFitStep& last) {
  std::vector<double> moved;
  for (std::size_t node = 0; node < model.mesh.nodes.size(); ++node) {
    const sim::Vector3 place_m =
        model.mesh.nodes[node] + last.displacement_m.segment<3>(static_cast<Eigen::Index>(3 * node));
    const sim::Vector3 by =
        (last.placement * place_m - model.mesh.nodes[node]) * sim::units_per_metre(model.unit);
    moved.insert(moved.end(), by.begin(), by.end());
  }
  write_text_file(file,
                  sim::vtu_text(model.mesh, model.unit, {{"displacement", {"X", "Y", "Z"}, moved}}, {}));
}

int fit_to_shape(const FitRequest& request, const sim::BreathingModel& model) {
  std::optional<sim::LandmarkPairs> landmarks;
  if (!request.landmarks.empty())
    landmarks = sim::read_landmark_pairs(request.landmarks[0], request.landmarks[1]);
  sim::ShapeFitOptions options;
  options.directions = request.directions;
  if (request.poisson_ratio) options.poisson_ratio = parse_number(*request.poisson_ratio, "--poisson-ratio");
  options.cross_validate = request.cross_validate;
  if (!request.correspondences.empty())
    options.correspondences =
        sim::read_correspondences({request.correspondences.begin(), request.correspondences.end()});
  const sim::LabelMap second = sim::read_label_map(*request.shape);
  const sim::ShapeFitResult found = [&] {
    StepLine line;
    return sim::fit_shape(model, second, options, [&](const std::string& step) { line.show(step); });
  }();
  std::optional<sim::LandmarkErrors> errors;
  if (landmarks) {
    errors = sim::errors_at(*landmarks, model.mesh, found.steps);
    if (errors->before_m.empty())
      throw Error("no landmark of " + request.landmarks[0] +
                  " is in the lung: are they in its patient coordinates, mm?");
  }
  if (!request.json) {
    for (const std::string& warning : found.warnings) print_error("kiroku", "warning: " + warning);
  }
  if (found.refusal.empty()) {
    write_model(request, model, found.motion);
    if (request.errors) {
      write_text_file(*request.errors, sim::landmark_csv(*errors, found.steps));
      write_text_file(fs::path(*request.errors).replace_extension(".svg"),
                      sim::landmark_plot(*errors, found.steps));
    }
    if (request.displacement) write_displacement(*request.displacement, model, found.steps.back());
  }
  if (request.json) {
    print_json(shape_json(request, model, found, errors));
  } else {
    print_shape(request, found, errors);
    if (request.errors) print_decomposition(*errors, found.steps.back().name);
  }
  if (found.refusal.empty()) return kDone;
  print_error("kiroku", found.refusal);
  return kAnswerIsNo;
}

int run(const FitRequest& request) {
  if (request.positions.has_value() == request.shape.has_value())
    throw UsageError(
        "say what to fit to: --positions (radiographs) or --shape (a second CT's mask), one of them");
  if (request.positions && (!request.landmarks.empty() || !request.correspondences.empty() ||
                            request.displacement || request.poisson_ratio || request.cross_validate)) {
    throw UsageError(
        "--landmarks, --correspondences, --displacement, --poisson-ratio and --cross-validate belong to "
        "--shape");
  }
  if (request.errors && request.landmarks.empty())
    throw UsageError("--errors needs --landmarks: points to tell the error at");
  if (request.errors && fs::path(*request.errors).extension() == ".svg")
    throw UsageError("--errors is for the numbers (.csv); their plot is written beside them (.svg)");
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
  command.option(
      "--correspondences", "CSV", request->correspondences,
      "with --shape: places that a program found in both CTs, six columns, x, y, z and x, y, z in mm");
  command.pair_option("--landmarks", "FIXED MOVING", request->landmarks,
                      "with --shape: points of both CTs, mm, to tell the error at");
  command.option("--displacement", "FILE", request->displacement,
                 "with --shape: where each node goes (.vtu), by the sliding boundary");
  command.option(
      "--errors", "FILE", request->errors,
      "with --landmarks: the error of each (.csv) with a plot beside it (.svg), and where it lies");
  command.option("--poisson-ratio", "NU", request->poisson_ratio,
                 "with --shape: of the tissue while the boundary slides, instead of the model's own");
  command.flag(
      "--cross-validate", request->cross_validate,
      "with --shape: also fits without each quarter of the second surface and tells the distance there");
  command.flag("--directions", request->directions,
               "seeks directions too: of the diaphragm (two views; the rib cage stays as it is), of both "
               "groups (--shape)");
  command.required_option("-o,--output", "FILE", request->output,
                          "the model with the motion that was found (.json)");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "From radiographs: amplitude and phase of rib cage and diaphragm, by least squares on the detectors. "
      "What the positions do not determine is refused. From a second shape: the rigid motion between the two "
      "CTs, then the amplitudes, then an even stretch of each lung, then a boundary that is brought to the "
      "second surface and slides along it, by elastic energy and distances both ways; each step's distance "
      "to the surface, and with landmarks its error there, is told beside what people themselves reach. "
      "Nothing is ever fitted on landmarks. With --correspondences the inside follows places that were found "
      "in both CTs; wrong ones among them lose their say. Where the last step does not meet the second shape "
      "(volume within 2 %, surface within 2 mm in the mean, no element inside out), the fit is refused with "
      "its numbers, nothing is written, and the exit status is 1.");
  command.example(
      "kiroku sim fit lung.json --positions seen.csv --geometry front.json --geometry side.json -o "
      "fitted.json",
      "from two views");
  command.example(
      "kiroku sim fit lung.json --shape inhale.mha --landmarks exhale.txt inhale.txt -o fitted.json",
      "from a second CT's mask, with the error at landmarks");
  command.example(
      "kiroku sim fit lung.json --shape inhale.mha --correspondences vessels.csv -o fitted.json "
      "--displacement moved.vtu",
      "also by places of the inside");
  command.example(
      "kiroku sim fit lung.json --shape inhale.mha --landmarks exhale.txt inhale.txt --errors errors.csv "
      "--cross-validate -o fitted.json",
      "also where that error lies, what the landmarks themselves allow, and how the surface is predicted");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

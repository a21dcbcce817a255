// 'kiroku sim fit-series': how a patient's lung breathes, from the pictures of a series of radiographs.
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>
#include <numbers>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "apps/sim/drr_request.h"
#include "apps/sim/frame_series.h"
#include "apps/sim/number_option.h"
#include "apps/sim/patient_of_material.h"
#include "apps/sim/radiograph_series.h"
#include "apps/sim/sim_command.h"
#include "apps/sim/volume_request.h"
#include "base/error.h"
#include "base/number_text.h"
#include "sim/drr/dicom_radiograph.h"
#include "sim/drr/registration.h"
#include "sim/respiration/tumour_track.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

struct FitSeriesRequest {
  VolumeRequest volume;
  std::string model, output;
  std::vector<std::string> radiographs, geometries, aligned;
  std::optional<std::string> polarity, rate, start, track;
  bool direction = false, force = false;
};

constexpr double kMillimetres = 1000;
/// Pictures are taken in pixels that are no smaller than this of the lesser side: what is finer is noise.
constexpr std::size_t kMostPixels = 256;

double degrees(double radians) { return radians * 180 / std::numbers::pi; }

void check(const FitSeriesRequest& request) {
  if (request.radiographs.empty() || request.radiographs.size() != request.geometries.size()) {
    throw UsageError("there are " + std::to_string(request.radiographs.size()) + " --radiographs and " +
                     std::to_string(request.geometries.size()) +
                     " --geometry: give one geometry for each, in the same order");
  }
  if (!request.aligned.empty() && request.aligned.size() != request.geometries.size())
    throw UsageError("--aligned-geometry is given " + std::to_string(request.aligned.size()) +
                     " times: name one file for each --geometry, in the same order");
  refuse_to_replace(request.output, request.force);
  if (request.track) refuse_to_replace(*request.track, request.force);
  for (const std::string& file : request.aligned) refuse_to_replace(file, request.force);
}

/// What was read: geometries as given, those of the pictures as they are kept, and these.
struct ReadSeries {
  std::vector<sim::ProjectionGeometry> given, views;
  std::vector<sim::SeriesPicture> pictures;
};

ReadSeries read_series(const FitSeriesRequest& request, StepLine& line) {
  ReadSeries series;
  const std::optional<double> rate =
      request.rate ? std::optional<double>(parse_number(*request.rate, "--rate", 0.01, 240)) : std::nullopt;
  const double start_s = request.start ? parse_number(*request.start, "--start") : 0;
  for (std::size_t view = 0; view < request.geometries.size(); ++view) {
    const std::string& file = request.geometries[view];
    series.given.push_back(
        (sim::is_dicom_file(file) ? sim::read_dicom_geometry(file) : sim::read_geometry(file)).geometry);
    const sim::ProjectionGeometry& geometry = series.given.back();
    const std::size_t factor =
        std::max<std::size_t>(std::min(geometry.columns(), geometry.rows()) / kMostPixels, 1);
    series.views.push_back(geometry.binned(factor));
    line.show("reading " + request.radiographs[view]);
    const auto radiographs = open_radiographs(request.radiographs[view], request.polarity, rate);
    while (std::optional<TimedRadiograph> next = radiographs->next()) {
      if (next->image.columns != geometry.columns() || next->image.rows != geometry.rows()) {
        throw Error(next->name + " has " + std::to_string(next->image.columns) + " x " +
                    std::to_string(next->image.rows) + " pixels, " + file + " says " +
                    std::to_string(geometry.columns()) + " x " + std::to_string(geometry.rows()) +
                    ": give the geometry that the radiographs were made with");
      }
      series.pictures.push_back(
          {start_s + next->time_s, view, sim::binned(next->image, factor), std::move(next->name)});
    }
  }
  return series;
}

nlohmann::ordered_json vector_json(const sim::Vector3& v) { return {v.x(), v.y(), v.z()}; }

nlohmann::ordered_json group_json(const sim::GroupMotion& motion, const sim::WaveFit& wave) {
  nlohmann::ordered_json object{{"amplitude_mm", kMillimetres * wave.amplitude_m},
                                {"amplitude_error_mm", kMillimetres * wave.amplitude_error_m},
                                {"phase_s", wave.phase_s},
                                {"phase_error_s", wave.phase_error_s},
                                {"baseline_mm", kMillimetres * wave.baseline_m},
                                {"baseline_error_mm", kMillimetres * wave.baseline_error_m},
                                {"drift_mm_per_min", 60 * kMillimetres * wave.drift_m_per_s},
                                {"drift_error_mm_per_min", 60 * kMillimetres * wave.drift_error_m_per_s},
                                {"explained", wave.explained},
                                {"left_mm", kMillimetres * wave.left_m}};
  if (motion.direction) object["direction"] = vector_json(*motion.direction);
  return object;
}

sim::Vector3 deviations_mm(const Eigen::Matrix3d& covariance) {
  return kMillimetres * covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
}

nlohmann::ordered_json json_of(const FitSeriesRequest& request, const sim::SeriesFit& fit,
                               const std::optional<sim::TumourTrack>& track,
                               const std::vector<std::string>& warnings, double took_s) {
  nlohmann::ordered_json object{
      {"file", request.output},
      {"moments", fit.moments.size()},
      {"views", request.geometries.size()},
      {"took_s", took_s},
      {"projections", fit.projections},
      {"gradient_correlation",
       {{"before", fit.similarity_before}, {"posed", fit.similarity_posed}, {"after", fit.similarity_after}}},
      {"change_explained", fit.change},
      {"change_by_chance", fit.change_by_chance}};
  if (fit.refusal.empty()) {
    object["pose"] = {
        {"translation_mm", vector_json(kMillimetres * fit.translation_m)},
        {"translation_scatter_mm", vector_json(deviations_mm(fit.pose_covariance.topLeftCorner<3, 3>()))},
        {"rotation_degrees", vector_json(degrees(1) * fit.rotation_rad)},
        {"rotation_scatter_degrees",
         vector_json(degrees(1) / kMillimetres *
                     deviations_mm(fit.pose_covariance.bottomRightCorner<3, 3>()))}};
    if (fit.waveform.periodic()) {
      object["cycle_s"] = fit.waveform.duration_s();
      object["cycle_error_s"] =
          fit.cycle ? nlohmann::ordered_json(fit.cycle->error_s) : nlohmann::ordered_json(nullptr);
    }
    object["rib_cage"] = group_json(fit.motion.rib_cage, fit.rib_cage);
    object["diaphragm"] = group_json(fit.motion.diaphragm, fit.diaphragm);
  }
  if (track) {
    nlohmann::ordered_json places = nlohmann::ordered_json::array();
    for (const sim::TumourMoment& moment : track->moments) {
      nlohmann::ordered_json place{{"time_s", moment.time_s},
                                   {"sight", sim::name_of(moment.sight)},
                                   {"views_seen", moment.views_seen},
                                   {"place_mm", nullptr},
                                   {"error_mm", nullptr}};
      if (moment.sight != sim::TumourSight::kLost) {
        place["place_mm"] = vector_json(kMillimetres * moment.place_m);
        place["error_mm"] = vector_json(deviations_mm(moment.covariance));
      }
      places.push_back(std::move(place));
    }
    object["tumour"] = {{"seen", track->seen},
                        {"predicted", track->predicted},
                        {"lost", track->lost},
                        {"from_the_lung_mm", kMillimetres * track->before_correction_m},
                        {"left_mm", kMillimetres * track->after_correction_m},
                        {"places", places}};
  }
  object["refusal"] =
      fit.refusal.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(fit.refusal);
  object["findings"] = fit.findings;
  object["warnings"] = warnings;
  return object;
}

std::string mm_text(double metres, double error_m) {
  return number_text(kMillimetres * metres, 3) + " +/- " + number_text(kMillimetres * error_m, 2);
}

void print_group(const char* name, const sim::GroupMotion& motion, const sim::WaveFit& wave) {
  std::cout << "  " << name << mm_text(wave.amplitude_m, wave.amplitude_error_m) << " mm, phase "
            << number_text(wave.phase_s, 3) << " +/- " << number_text(wave.phase_error_s, 2)
            << " s, baseline " << mm_text(wave.baseline_m, wave.baseline_error_m) << " mm, drift "
            << mm_text(60 * wave.drift_m_per_s, 60 * wave.drift_error_m_per_s) << " mm a minute";
  if (motion.direction) {
    std::cout << ", along (" << number_text(motion.direction->x(), 3) << ", "
              << number_text(motion.direction->y(), 3) << ", " << number_text(motion.direction->z(), 3)
              << ")";
  }
  std::cout << "; explains " << number_text(100 * wave.explained, 3) << " %, leaves "
            << number_text(kMillimetres * wave.left_m, 2) << " mm\n";
}

void print_fit(const FitSeriesRequest& request, const sim::SeriesFit& fit,
               const std::optional<sim::TumourTrack>& track, double took_s) {
  const sim::Vector3 mm = kMillimetres * fit.translation_m, turn = degrees(1) * fit.rotation_rad;
  std::cout << printable(request.output) << ": fitted to " << fit.moments.size() << " moments in "
            << request.geometries.size() << (request.geometries.size() == 1 ? " view, in " : " views, in ")
            << number_text(took_s, 3) << " s\n  the patient lay " << number_text(mm.x(), 3) << ", "
            << number_text(mm.y(), 3) << ", " << number_text(mm.z(), 3)
            << " mm to the left, back and head, turned by " << number_text(turn.x(), 3) << ", "
            << number_text(turn.y(), 3) << ", " << number_text(turn.z(), 3) << " degrees about these\n";
  if (request.geometries.size() == 1) {
    std::cout << "  from one view neither the depth nor a turn is sure: either can be off by millimetres and "
                 "degrees, and the amplitudes with them\n";
  }
  if (fit.cycle) {
    std::cout << "  a breath lasts " << number_text(fit.cycle->cycle_s, 4) << " +/- "
              << number_text(fit.cycle->error_s, 2) << " s\n";
  } else if (fit.waveform.periodic()) {
    std::cout << "  a breath lasts " << number_text(fit.waveform.duration_s(), 4)
              << " s, as the model says: the series is too short to tell\n";
  }
  print_group("rib cage   ", fit.motion.rib_cage, fit.rib_cage);
  print_group("diaphragm  ", fit.motion.diaphragm, fit.diaphragm);
  std::cout << "  gradient correlation " << number_text(fit.similarity_before, 3) << ", "
            << number_text(fit.similarity_posed, 3) << " with the pose, "
            << number_text(fit.similarity_after, 3)
            << " with breathing; the pictures' change and the waveform's agree to "
            << number_text(fit.change, 2) << " (by chance " << number_text(fit.change_by_chance, 2) << ")\n";
  if (!track) return;
  std::cout << "  tumour: seen in " << track->seen << " moments, predicted in " << track->predicted
            << ", lost in " << track->lost;
  if (track->seen > 0) {
    std::cout << "; seen " << number_text(kMillimetres * track->before_correction_m, 2)
              << " mm from where the lung has it, "
              << number_text(kMillimetres * track->after_correction_m, 2) << " mm once that is corrected";
  }
  std::cout << "\n";
  if (request.track) std::cout << "  " << printable(*request.track) << "   where it is in each\n";
}

int run(const FitSeriesRequest& request) {
  check(request);
  const auto begin = std::chrono::steady_clock::now();
  auto line = std::make_optional<StepLine>();
  const sim::BreathingModel model = sim::read_breathing_model(request.model);
  if (request.track) static_cast<void>(model.needed_tumour());
  const ReadSeries series = read_series(request, *line);
  line->show("reading " + request.volume.path);
  sim::VolumeFile file = sim::read_volume(request.volume.path, request.volume.options());
  std::vector<std::string> warnings = model.warnings;
  warnings.insert(warnings.end(), file.findings.begin(), file.findings.end());
  const PatientIds of_ct = patients_of_ct(request.volume.path, request.volume.options().series);
  for (const std::string& radiographs : request.radiographs) {
    if (auto warning = patient_warning(of_ct, radiographs, patients_of_radiographs(radiographs)))
      warnings.push_back(std::move(*warning));
  }
  sim::BreathingScene scene(model, file.volume);
  sim::SeriesFitOptions options;
  options.direction = request.direction;
  options.progress = [&](const std::string& doing, std::size_t done, std::size_t all) {
    line->show(doing + ", " + std::to_string(done) + " of " + std::to_string(all));
  };
  const sim::SeriesFit fit = sim::fit_series(model, scene, series.views, series.pictures, options);
  std::optional<sim::TumourTrack> track;
  if (fit.refusal.empty() && model.tumour) {
    line->show("looking for the tumour");
    track = sim::track_tumour(model, scene, file.volume, series.views, series.pictures, fit);
  }
  line.reset();
  if (fit.refusal.empty()) {
    const fs::path output = request.output;
    write_text_file(
        output, sim::with_motion(model, request.model, fit.motion, fs::absolute(output).parent_path(),
                                 fit.waveform.periodic() ? std::optional<double>(fit.waveform.duration_s())
                                                         : std::nullopt));
    if (request.track) write_text_file(*request.track, sim::track_csv(*track));
    for (std::size_t view = 0; view < request.aligned.size(); ++view)
      write_text_file(request.aligned[view],
                      sim::geometry_json(series.given[view].of_moved_patient(fit.pose)));
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  if (request.volume.json) {
    print_json(json_of(request, fit, track, warnings, took.count()));
  } else {
    for (const std::string& warning : warnings) print_error("kiroku", "warning: " + warning);
    for (const std::string& finding : fit.findings) print_error("kiroku", "note: " + finding);
    if (fit.refusal.empty()) print_fit(request, fit, track, took.count());
  }
  if (fit.refusal.empty()) return kDone;
  print_error("kiroku", fit.refusal);
  return kAnswerIsNo;
}

}  // namespace

void add_sim_fit_series_command(Command& sim) {
  Command& command = sim.add_command(
      "fit-series", "finds how a patient's lung breathes, by the pictures of a series themselves");
  const auto request = std::make_shared<FitSeriesRequest>();
  add_volume_options(command, request->volume);
  command.argument("BREATHING", request->model,
                   "the breathing lung to begin with (.json), as for sim respire");
  command.option(
      "--radiographs", "PATH", request->radiographs,
      "of each view: a folder of DICOM, .png or .mha files, a DICOM file of several pictures, or a film");
  command.option("-g,--geometry", "FILE", request->geometries,
                 "of each view, in the same order: source and detector (.json), or an RT Image (.dcm)");
  command.choice("--polarity", {"bone-white", "bone-black"}, request->polarity, "of the radiographs",
                 "a DICOM file's own, else bone-white");
  command.option("--rate", "N", request->rate, "pictures a second", "their own; 10 of a folder");
  command.option("--start", "S", request->start, "the waveform's moment at the first picture", "0");
  command.flag("--direction", request->direction, "seeks where the diaphragm moves to as well");
  command.required_option("-o,--output", "FILE", request->output,
                          "the model with the motion that was found (.json)");
  command.option("--track", "CSV", request->track,
                 "where the tumour is in each moment, with its uncertainty, and whether it was seen");
  command.option("--aligned-geometry", "FILE", request->aligned,
                 "of each view: the geometry by which the CT lies as the patient did (.json)");
  command.flag("--force", request->force, "replaces the files");
  command.explain(
      "Finds how the patient lay (from some 13 mm and 5 degrees away; from farther it may be refused), "
      "how far rib cage and diaphragm moved in each picture, and the amplitude, phase, baseline and "
      "drift with which the model's waveform follows that; of a sine the cycle, too. Gradient "
      "correlation is made greatest, in pixels that become smaller. What stays the same in all pictures "
      "and is not in the CT, as couch and tubes, loses its say. Pictures of several views with the same "
      "time are of one moment.");
  command.explain(
      "The tumour is sought in each picture near where the lung has it, by its own DRR. The table says for "
      "each "
      "moment where it is in the geometries' room, mm to the left, back and head, with standard deviations; "
      "seen: "
      "it stands out in a picture; predicted: the lung's motion, corrected by all pictures that show the "
      "tumour, "
      "says so; lost: the pictures do not look like the lung, and no place is told. Its document has no "
      "pose: "
      "pictures of it are to be made with --aligned-geometry.");
  command.explain(
      "Radiographs that the CT does not explain (another geometry, mirrored or turned pictures, exchanged "
      "dark "
      "and light) and a series without breathing are refused with the numbers and with what was tried; "
      "nothing "
      "is written, and the exit status is 1. Another patient of the same build is not always told apart.");
  command.example(
      "kiroku sim fit-series ct/ lung.json --radiographs fluoroscopy.dcm -g front.json -o fitted.json "
      "--track tumour.csv",
      "from one view");
  command.example(
      "kiroku sim fit-series ct/ lung.json --radiographs front/ -g front.json --radiographs side/ -g "
      "side.json --rate 5 -o fitted.json --track tumour.csv",
      "from two views, five pictures a second");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

// 'kiroku sim respire': a lung that breathes, and where its tumour goes.
#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/sim/frame_series.h"
#include "apps/sim/number_option.h"
#include "apps/sim/sim_command.h"
#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/mesh_writer.h"
#include "sim/respiration/breathing_model.h"
#include "sim/respiration/irradiation_field.h"
#include "sim/respiration/line_plot.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

struct RespireRequest {
  std::string model, output;
  std::optional<std::string> margin;
  bool force = false, json = false;
};

/// A phase as 'plan run' writes frames: displacement on the undeformed mesh.
std::string frame_vtu(const sim::BreathingModel& model, const Eigen::VectorXd& displacement_m,
                      const std::vector<double>& groups) {
  const Eigen::VectorXd displacement = displacement_m * sim::units_per_metre(model.unit);
  return sim::vtu_text(model.mesh, model.unit,
                       {{"displacement",
                         {"X", "Y", "Z"},
                         std::span(displacement.data(), static_cast<std::size_t>(displacement.size()))},
                        {"boundary_group", {}, groups}},
                       {});
}

std::string path_plot(const sim::TumourPath& path) {
  constexpr double kMillimetres = 1000;
  sim::LinePlot plot{"Tumour's centre from its place at rest", "time, s", "mm", {}};
  constexpr std::array<const char*, 3> kNames{"to the left (x)", "to the back (y)", "to the head (z)"};
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    sim::PlotLine line{kNames[static_cast<std::size_t>(axis)], path.times_s, {}};
    for (const sim::Vector3& centre_m : path.centres_m)
      line.y.push_back(kMillimetres * (centre_m - path.rest_m)[axis]);
    plot.lines.push_back(std::move(line));
  }
  return sim::plot_svg(plot);
}

/// In metres; nothing where no field was asked for.
std::optional<double> margin_of(const RespireRequest& request) {
  if (!request.margin) return std::nullopt;
  constexpr double kMostMm = 100, kMillimetresPerMetre = 1000;
  return parse_number(*request.margin, "--margin", 0, kMostMm) / kMillimetresPerMetre;
}

nlohmann::ordered_json vector_json(const sim::Vector3& v) { return {v.x(), v.y(), v.z()}; }

int run(const RespireRequest& request) {
  const sim::BreathingModel model = sim::read_breathing_model(request.model);
  if (!request.json) {
    for (const std::string& warning : model.warnings) print_error("kiroku", "warning: " + warning);
  }
  const std::optional<double> margin_m = margin_of(request);
  if (margin_m) static_cast<void>(model.needed_tumour());
  FrameSeries series(request.output, "respire", request.force, {"tumour.csv", "tumour.svg"});
  const auto begin = std::chrono::steady_clock::now();
  const sim::BreathingBody body(model.mesh, model.materials, model.groups, model.slide);
  const sim::BreathingCycle cycle(body, model.motion, model.waveform);
  std::vector<double> group_numbers;
  for (const sim::BoundaryGroup group : model.groups) group_numbers.push_back(static_cast<double>(group));
  sim::TumourPath path;
  sim::MeshPoint centre;
  if (model.tumour) {
    centre = sim::centre_of(model.mesh, *model.tumour);
    path.rest_m = centre.mean(model.mesh.nodes);
  }
  std::vector<Eigen::VectorXd> displacements_m;
  Progress progress("breathing");
  for (const double time_s : model.times_s()) {
    const Eigen::VectorXd displacement_m = cycle.displacement_m(time_s);
    series.add(time_s, frame_vtu(model, displacement_m, group_numbers));
    if (model.tumour) {
      path.times_s.push_back(time_s);
      path.centres_m.push_back(path.rest_m + centre.mean(displacement_m));
    }
    if (margin_m) displacements_m.push_back(displacement_m);
    progress.update(series.count(), model.phases);
  }
  progress.clear();
  series.finish();
  const fs::path folder = request.output;
  if (model.tumour) {
    write_text_file(folder / "tumour.csv", sim::path_csv(path, model.unit));
    write_text_file(folder / "tumour.svg", path_plot(path));
  }
  std::optional<sim::IrradiationField> field;
  if (margin_m) field = sim::irradiation_field(model.mesh, *model.tumour, displacements_m, *margin_m);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  const auto counts = sim::counts_of(model.groups);
  const sim::Vector3 excursion = 1000 * sim::excursion_m(path);
  if (request.json) {
    nlohmann::ordered_json nodes = nlohmann::ordered_json::object();
    for (std::size_t group = 0; group < counts.size(); ++group)
      nodes[sim::name_of(static_cast<sim::BoundaryGroup>(group))] = counts[group];
    nlohmann::ordered_json object{{"folder", request.output},
                                  {"frames", series.count()},
                                  {"nodes", model.mesh.nodes.size()},
                                  {"groups", nodes},
                                  {"computed_s", took.count()}};
    if (model.tumour) object["tumour_excursion_mm"] = vector_json(excursion);
    if (field) {
      object["irradiation_field"] = {{"margin_mm", 1000 * field->margin_m},
                                     {"tumour_ml", 1e6 * field->tumour_m3},
                                     {"conventional_ml", 1e6 * field->conventional_m3},
                                     {"tracking_ml", 1e6 * field->tracking_m3},
                                     {"ratio", field->ratio()}};
    }
    object["warnings"] = model.warnings;
    print_json(object);
    return kDone;
  }
  std::cout << printable(request.output) << ": " << series.count() << " phases of "
            << number_text(model.waveform.duration_s(), 4) << " s, computed and written in "
            << number_text(took.count(), 3) << " s\n  nodes of the surface:";
  for (std::size_t group = 1; group < counts.size(); ++group) {
    std::cout << (group == 1 ? " " : ", ") << sim::name_of(static_cast<sim::BoundaryGroup>(group)) << " "
              << counts[group];
  }
  std::cout << "\n";
  if (model.tumour) {
    std::cout << "  the tumour moves by " << number_text(excursion.x(), 3) << " mm left to right, "
              << number_text(excursion.y(), 3) << " mm front to back, " << number_text(excursion.z(), 3)
              << " mm feet to head\n  " << printable((folder / "tumour.csv").string())
              << "   where it is when; tumour.svg beside it\n";
  }
  if (field) {
    std::cout << "  irradiation field with a margin of " << number_text(1000 * field->margin_m, 3)
              << " mm: " << number_text(1e6 * field->conventional_m3, 4) << " ml over the whole path, "
              << number_text(1e6 * field->tracking_m3, 4) << " ml when it follows the tumour, "
              << number_text(100 * field->ratio(), 3) << " % of it\n";
  }
  std::cout << "  " << printable((folder / "respire.pvd").string())
            << "  for ParaView (Warp By Vector: displacement; colour: boundary_group)\n";
  return kDone;
}

}  // namespace

void add_sim_respire_command(Command& sim) {
  Command& command =
      sim.add_command("respire", "a lung that breathes: meshes over the cycle, the tumour's path");
  const auto request = std::make_shared<RespireRequest>();
  command.argument("MODEL", request->model, "the breathing lung (.json)");
  command.required_option("-o,--output", "DIR", request->output, "where to; absent or empty");
  command.option("--margin", "MM", request->margin,
                 "around the tumour: what a field over its whole path takes, and one that follows it");
  command.flag("-f,--force", request->force, "replaces what an earlier run left in DIR");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "The model is {\"mesh\": \"lung.msh\", \"length_unit\": \"mm\", \"labels\": "
      "\"totalsegmentator.nii.gz\", "
      "\"tumour\": {\"region\": 2}, \"breathing\": {\"cycle_s\": 3.6, \"rib_cage\": {\"amplitude\": 3}, "
      "\"diaphragm\": {\"amplitude\": 10, \"phase_s\": 0.6}}, \"phases\": 36}. Only mesh and length_unit "
      "must be "
      "there. What of the surface is rib cage, diaphragm, trachea and back is found from its shape, better "
      "with "
      "labels, and can be changed in 'groups'.");
  command.explain(
      "Writes DIR/respire.pvd with DIR/frames/*.vtu (displacement, boundary_group: 0 inside, 1 free, 2 rib "
      "cage, "
      "3 diaphragm, 4 trachea, 5 back), and with a tumour tumour.csv and tumour.svg.");
  command.example("kiroku sim respire lung.json -o breathing", "one cycle");
  command.example("kiroku sim respire lung.json -o breathing --margin 5",
                  "and how much tissue tracking the tumour spares, 5 mm around it");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

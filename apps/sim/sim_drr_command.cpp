// 'kiroku sim drr': a radiograph computed from a CT.
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/kiroku/output_file.h"
#include "apps/sim/drr_request.h"
#include "apps/sim/sim_command.h"
#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::apps {
namespace {

struct Request {
  DrrRequest drr;
  std::string output;
  std::optional<std::string> response, window, polarity;
  std::vector<std::string> points;
  bool force = false;
};

constexpr double kMmPerM = 1000;

void check(const Request& request) {
  const auto ending = std::filesystem::path(request.output).extension();
  if (ending != ".mha" && ending != ".png") {
    throw UsageError("--output is '" + request.output +
                     "': its ending must be .mha (line integrals) or .png (a picture)");
  }
  if (ending == ".mha" && (request.response || request.window || request.polarity)) {
    throw UsageError("--response, --window and --polarity are of pictures: name a .png, or leave them out");
  }
  refuse_to_replace(request.output, request.force);
}

struct SeenPoint {
  sim::Vector3 point_mm;
  std::optional<sim::PixelPoint> seen;
};

std::vector<SeenPoint> seen_points(const Request& request, const sim::ProjectionGeometry& geometry) {
  std::vector<SeenPoint> points;
  for (const std::string& text : request.points) {
    const std::vector<double> numbers = parse_numbers(text, ',', 3, "--point");
    const sim::Vector3 point_mm(numbers[0], numbers[1], numbers[2]);
    points.push_back({point_mm, geometry.project(point_mm / kMmPerM)});
  }
  return points;
}

/// At the detector; nothing where a matrix does not tell how large it is.
std::optional<std::array<double, 2>> pixel_mm(const sim::GeometryDocument& machine) {
  if (!machine.gantry) return std::nullopt;
  return std::array<double, 2>{kMmPerM * machine.gantry->size_m[0] / double(machine.gantry->pixels[0]),
                               kMmPerM * machine.gantry->size_m[1] / double(machine.gantry->pixels[1])};
}

void write(const Request& request, ByteView bytes) {
  OutputFile output(request.output);
  output.write(bytes);
  output.commit(OutputFile::Durability::kEventually);
}

std::optional<sim::Window> write_image(const Request& request, const sim::ProjectionImage& image,
                                       const sim::GeometryDocument& machine) {
  if (std::filesystem::path(request.output).extension() == ".mha") {
    write(request, bytes_of(sim::mha_of(image, pixel_mm(machine))));
    return std::nullopt;
  }
  const sim::Response response =
      request.response == "transmission" ? sim::Response::kTransmission : sim::Response::kFilm;
  sim::Window window = sim::window_of(image, response);
  if (request.window) {
    const std::vector<double> bounds = parse_numbers(*request.window, ':', 2, "--window");
    window = {bounds[0], bounds[1]};
  }
  const sim::Polarity polarity =
      request.polarity == "bone-black" ? sim::Polarity::kBoneBlack : sim::Polarity::kBoneWhite;
  write(request, sim::png_of(sim::picture_of(image, response, window, polarity)));
  return window;
}

int run(const Request& request) {
  check(request);
  const auto begin = std::chrono::steady_clock::now();
  auto line = std::make_optional<StepLine>();
  const DrrScene scene(request.drr, *line);
  const sim::ProjectionGeometry& geometry = scene.machine().geometry;
  const std::vector<SeenPoint> points = seen_points(request, geometry);
  const sim::ProjectionImage image = scene.project(geometry);
  const auto window = write_image(request, image, scene.machine());
  line.reset();
  const auto [least, greatest] = std::ranges::minmax(image.values);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  if (request.drr.volume.json) {
    nlohmann::ordered_json seen = nlohmann::ordered_json::array();
    for (const SeenPoint& point : points) {
      nlohmann::ordered_json entry{{"point_mm", {point.point_mm.x(), point.point_mm.y(), point.point_mm.z()}},
                                   {"pixel", nullptr}};
      if (point.seen) entry["pixel"] = {point.seen->column, point.seen->row};
      seen.push_back(entry);
    }
    nlohmann::ordered_json object{{"file", request.output},
                                  {"columns", image.columns},
                                  {"rows", image.rows},
                                  {"energy_kev", scene.attenuation().energy_kev()},
                                  {"water_per_m", scene.attenuation().water_per_m()},
                                  {"least_integral", least},
                                  {"greatest_integral", greatest},
                                  {"source_mm",
                                   {kMmPerM * geometry.source_m().x(), kMmPerM * geometry.source_m().y(),
                                    kMmPerM * geometry.source_m().z()}}};
    if (window) object["window"] = {window->low, window->high};
    object["points"] = seen;
    object["took_s"] = took.count();
    object["findings"] = scene.findings();
    print_json(object);
    return kDone;
  }
  for (const std::string& finding : scene.findings()) print_error("kiroku", "warning: " + finding);
  std::cout << printable(request.output) << ": " << image.columns << " x " << image.rows
            << " pixels, line integrals " << number_text(double(least), 4) << " to "
            << number_text(double(greatest), 4) << " at " << number_text(scene.attenuation().energy_kev())
            << " keV, in " << number_text(took.count(), 3) << " s\n";
  if (window) {
    std::cout << "  shown is from " << number_text(window->low, 4) << " to " << number_text(window->high, 4)
              << (request.response == "transmission" ? " of the rays that arrive\n"
                                                     : " of the line integrals\n");
  }
  for (const SeenPoint& point : points) {
    std::cout << "  (" << number_text(point.point_mm.x()) << ", " << number_text(point.point_mm.y()) << ", "
              << number_text(point.point_mm.z()) << ") mm is ";
    if (point.seen) {
      std::cout << "at column " << number_text(point.seen->column) << ", row " << number_text(point.seen->row)
                << "\n";
    } else {
      std::cout << "not in front of the source\n";
    }
  }
  return kDone;
}

}  // namespace

void add_sim_drr_command(Command& sim) {
  Command& command = sim.add_command("drr", "a radiograph computed from a CT, also from a deformed one");
  const auto request = std::make_shared<Request>();
  add_drr_options(command, request->drr);
  command.choice("--response", {"film", "transmission"}, request->response,
                 "of a picture: the line integrals, as a film shows, or the rays that arrive", "film");
  command.option("--window", "LOW:HIGH", request->window, "of a picture: what of the response is shown",
                 "0.5 to 99.5 % of the patient");
  command.choice("--polarity", {"bone-white", "bone-black"}, request->polarity, "of a picture", "bone-white");
  command.option("--point", "X,Y,Z", request->points,
                 "tells which pixel shows this place in the patient, mm");
  command.required_option("-o,--output", "FILE", request->output, "where to: .mha or .png");
  command.flag("--force", request->force, "replaces the file");
  command.explain(
      "The geometry is {\"sad_mm\": 1000, \"sid_mm\": 1500, \"isocenter_mm\": [14, 8, -175], \"gantry_deg\": "
      "0, "
      "\"detector_px\": [512, 512], \"detector_mm\": [600, 600]}: distances from the source to the axis and "
      "to "
      "the detector, the gantry's angle of IEC 61217 (0: the source is in front of the patient, 90: on the "
      "left). "
      "Or {\"matrix\": [[...], [...], [...]], \"detector_px\": [512, 512]}, three rows of four numbers that "
      "take "
      "the patient's millimetres (left, back, head) to pixels.");
  command.explain(
      "A .mha holds the integrals of attenuation along the rays, a .png of 16 bits what arrives of them. "
      "With a "
      "mesh, what is inside moves with it, what is outside (ribs, spine, couch) stays.");
  command.example("kiroku sim drr ct/ -g front.json -o front.png", "the patient from the front");
  command.example(
      "kiroku sim drr ct/ --mesh lung.msh --displacement breathing/frames/00018.vtu -g front.json -o in.png",
      "breathed in");
  command.example("kiroku sim drr ct/ -g front.json --gantry 90 -o left.mha --point 14,8,-175",
                  "line integrals from the left; where a point is seen");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

// 'kiroku sim overlay': a computed radiograph over a real one.
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <numbers>
#include <optional>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/kiroku/output_file.h"
#include "apps/sim/drr_request.h"
#include "apps/sim/frame_series.h"
#include "apps/sim/sim_command.h"
#include "base/error.h"
#include "base/number_text.h"
#include "sim/drr/dicom_radiograph.h"
#include "sim/drr/overlay.h"
#include "sim/drr/registration.h"
#include "sim/model/body_model.h"
#include "sim/respiration/landmarks.h"
#include "sim/respiration/line_plot.h"
#include "sim/respiration/number_table.h"

namespace kiroku::apps {
namespace {

constexpr double kMmPerM = 1000;
constexpr sim::Colour kOutlineColour{255, 200, 0}, kPathColour{255, 70, 70}, kMeasuredColour{90, 255, 90};

struct Request {
  DrrRequest drr;
  std::string radiograph, output;
  std::optional<std::string> mode, opacity, polarity, outline, path, measured, aligned, plot;
  bool align = false, force = false;
};

void check(const Request& request) {
  if (std::filesystem::path(request.output).extension() != ".png") {
    throw UsageError("--output is '" + request.output + "': its ending must be .png");
  }
  if (request.plot && std::filesystem::path(*request.plot).extension() != ".svg") {
    throw UsageError("--error-plot is '" + *request.plot + "': its ending must be .svg");
  }
  if (request.plot && (!request.path || !request.measured)) {
    throw UsageError("--error-plot shows how far --path is from --measured: give both");
  }
  if (request.aligned && !request.align)
    throw UsageError("--aligned-geometry is what --align finds: give both");
  if (request.outline && !request.drr.mesh)
    throw UsageError("--outline names a region of a mesh: give --mesh too");
  if (request.opacity && request.mode.value_or("opacity") != "opacity") {
    throw UsageError("--opacity is of --mode opacity");
  }
  refuse_to_replace(request.output, request.force);
  if (request.plot) refuse_to_replace(*request.plot, request.force);
  if (request.aligned) refuse_to_replace(*request.aligned, request.force);
}

/// Light where much attenuates.
sim::ProjectionImage read_radiograph(const Request& request) {
  if (sim::is_dicom_file(request.radiograph)) {
    std::optional<sim::Polarity> stated;
    if (request.polarity) {
      stated = *request.polarity == "bone-black" ? sim::Polarity::kBoneBlack : sim::Polarity::kBoneWhite;
    }
    return sim::read_dicom_radiograph(request.radiograph, stated);
  }
  sim::ProjectionImage image;
  if (std::filesystem::path(request.radiograph).extension() == ".png") {
    const sim::GreyPicture picture = sim::read_png(request.radiograph);
    image = {picture.columns, picture.rows, {}};
    // As line integrals are, of some units.
    constexpr float kScale = 5.0F / 65535;
    for (const std::uint16_t grey : picture.values) image.values.push_back(kScale * static_cast<float>(grey));
  } else {
    image = sim::read_mha(request.radiograph);
  }
  if (request.polarity == "bone-black") {
    const float most = *std::ranges::max_element(image.values);
    for (float& value : image.values) value = most - value;
  }
  return image;
}

sim::OverlayMode mode_of(const std::string& name) {
  if (name == "difference") return sim::OverlayMode::kDifference;
  if (name == "checkerboard") return sim::OverlayMode::kCheckerboard;
  if (name == "contour") return sim::OverlayMode::kContour;
  if (name == "beside") return sim::OverlayMode::kBeside;
  return sim::OverlayMode::kOpacity;
}

struct Path {
  std::vector<double> times_s;
  std::vector<sim::Vector3> points_m;
};

/// The columns time_s, x_mm, y_mm, z_mm (or _m), as 'kiroku sim respire' writes them.
Path read_path(const std::string& file) {
  const sim::NumberTable table = sim::NumberTable::parse(sim::read_document(file), file);
  const bool metres = !table.column("x_mm") && table.column("x_m");
  const std::string unit = metres ? "_m" : "_mm";
  const std::size_t time = table.needed_column("time_s"), x = table.needed_column("x" + unit),
                    y = table.needed_column("y" + unit), z = table.needed_column("z" + unit);
  Path path;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (row > 0 && !(table.at(row, time) > path.times_s.back())) {
      table.fail(row, "is not later than the one before");
    }
    path.times_s.push_back(table.at(row, time));
    path.points_m.push_back(sim::Vector3(table.at(row, x), table.at(row, y), table.at(row, z)) /
                            (metres ? 1 : kMmPerM));
  }
  if (table.rows() < 2) table.fail(0, "begins a path of fewer than two places");
  return path;
}

/// Between two of its moments, evenly.
std::optional<sim::Vector3> place_at(const Path& path, double time_s) {
  const auto after = std::ranges::lower_bound(path.times_s, time_s);
  if (after == path.times_s.end()) return std::nullopt;
  const auto i = static_cast<std::size_t>(after - path.times_s.begin());
  if (path.times_s[i] == time_s) return path.points_m[i];
  if (i == 0) return std::nullopt;
  const double part = (time_s - path.times_s[i - 1]) / (path.times_s[i] - path.times_s[i - 1]);
  return (1 - part) * path.points_m[i - 1] + part * path.points_m[i];
}

struct PositionError {
  std::vector<double> times_s, in_space_mm, across_ray_mm;
  sim::Spread spread_mm;  // in space
};

PositionError error_of(const Path& path, const Path& measured, const sim::Vector3& source_m,
                       const std::string& file) {
  PositionError error;
  for (std::size_t i = 0; i < measured.times_s.size(); ++i) {
    const auto place = place_at(path, measured.times_s[i]);
    if (!place) continue;
    const sim::Vector3 offset = *place - measured.points_m[i];
    const sim::Vector3 ray = (measured.points_m[i] - source_m).normalized();
    error.times_s.push_back(measured.times_s[i]);
    error.in_space_mm.push_back(kMmPerM * offset.norm());
    error.across_ray_mm.push_back(kMmPerM * (offset - offset.dot(ray) * ray).norm());
  }
  if (error.times_s.empty()) {
    throw Error("cannot use " + file + ": none of its moments is among those of --path, " +
                number_text(path.times_s.front()) + " to " + number_text(path.times_s.back()) + " s");
  }
  error.spread_mm = sim::spread_of(error.in_space_mm);
  return error;
}

std::string plot_of(const PositionError& error) {
  sim::LinePlot plot{"Path from the measured places", "time, s", "mm", {}};
  plot.lines.push_back({"in space", error.times_s, error.in_space_mm});
  plot.lines.push_back({"as the radiograph shows it", error.times_s, error.across_ray_mm});
  return sim::plot_svg(plot);
}

void draw_twice(sim::ColourPicture& picture, const std::vector<sim::PixelLine>& lines,
                const sim::Colour& colour, std::size_t columns) {
  sim::draw(picture, lines, colour);
  if (picture.columns > columns) sim::draw(picture, lines, colour, double(columns));
}

std::int32_t region_of(const Request& request, const sim::TetMesh& mesh) {
  const double number = parse_number(*request.outline, "--outline");
  const std::vector<std::int32_t> regions = sim::regions_of(mesh);
  for (const std::int32_t region : regions) {
    if (double(region) == number) return region;
  }
  std::string known;
  for (const std::int32_t region : regions) known += (known.empty() ? "" : ", ") + std::to_string(region);
  throw UsageError("--outline is '" + *request.outline + "', no region of the mesh; it has " + known);
}

int run(const Request& request) {
  check(request);
  const double opacity = request.opacity ? parse_number(*request.opacity, "--opacity") : 0.5;
  if (!(opacity >= 0 && opacity <= 1))
    throw UsageError("--opacity is " + *request.opacity + "; it must be from 0 to 1");
  const sim::ProjectionImage radiograph = read_radiograph(request);
  std::optional<Path> path, measured;
  if (request.path) path = read_path(*request.path);
  if (request.measured) measured = read_path(*request.measured);
  auto line = std::make_optional<StepLine>();
  const DrrScene scene(request.drr, *line);
  const std::optional<std::int32_t> region =
      request.outline ? std::optional(region_of(request, scene.deformed_mesh())) : std::nullopt;
  line.reset();
  sim::ProjectionGeometry geometry = scene.machine().geometry;
  std::optional<sim::Registration> found;
  if (request.align) {
    Progress progress("aligning");
    found = sim::register_rigidly(
        radiograph, geometry, scene.middle_m(),
        [&](const sim::ProjectionGeometry& seen_by) { return scene.project(seen_by); },
        [&](std::size_t done, std::size_t all) { progress.update(done, all); });
    geometry = geometry.of_moved_patient(found->motion);
  }
  const sim::ProjectionImage drr = scene.project(geometry);
  const double similarity = found ? found->similarity_after : sim::gradient_correlation(radiograph, drr);
  sim::ColourPicture picture =
      sim::overlay_of(radiograph, drr, mode_of(request.mode.value_or("opacity")), opacity);
  if (region) {
    draw_twice(picture, sim::outline_of(scene.deformed_mesh(), *region, geometry), kOutlineColour,
               drr.columns);
  }
  if (path) draw_twice(picture, sim::path_of(path->points_m, geometry), kPathColour, drr.columns);
  if (measured) draw_twice(picture, sim::path_of(measured->points_m, geometry), kMeasuredColour, drr.columns);
  std::optional<PositionError> error;
  if (path && measured) error = error_of(*path, *measured, geometry.source_m(), *request.measured);
  OutputFile output(request.output);
  output.write(sim::png_of(picture));
  output.commit(OutputFile::Durability::kEventually);
  if (request.plot) write_text_file(*request.plot, plot_of(*error));
  if (request.aligned) write_text_file(*request.aligned, sim::geometry_json(geometry));

  const auto degrees = [](double radians) { return radians * 180 / std::numbers::pi; };
  if (request.drr.volume.json) {
    nlohmann::ordered_json object{{"file", request.output},
                                  {"columns", picture.columns},
                                  {"rows", picture.rows},
                                  {"gradient_correlation", similarity}};
    if (found) {
      const sim::Vector3 mm = kMmPerM * found->translation_m;
      object["alignment"] = {{"gradient_correlation_before", found->similarity_before},
                             {"gradient_correlation_after", found->similarity_after},
                             {"translation_mm", {mm.x(), mm.y(), mm.z()}},
                             {"rotation_deg",
                              {degrees(found->rotation_rad.x()), degrees(found->rotation_rad.y()),
                               degrees(found->rotation_rad.z())}},
                             {"projections", found->projections}};
    }
    if (error) {
      object["position_error_mm"] = {{"mean", error->spread_mm.mean},
                                     {"standard_deviation", error->spread_mm.deviation},
                                     {"greatest", error->spread_mm.greatest},
                                     {"moments", error->times_s.size()}};
    }
    object["findings"] = scene.findings();
    print_json(object);
    return kDone;
  }
  for (const std::string& finding : scene.findings()) print_error("kiroku", "warning: " + finding);
  std::cout << printable(request.output) << ": " << picture.columns << " x " << picture.rows
            << " pixels, gradient correlation " << number_text(similarity, 4) << "\n";
  if (found) {
    const sim::Vector3 mm = kMmPerM * found->translation_m;
    std::cout << "  aligned: from " << number_text(found->similarity_before, 4) << " to "
              << number_text(found->similarity_after, 4) << "; the patient lay " << number_text(mm.x(), 3)
              << ", " << number_text(mm.y(), 3) << ", " << number_text(mm.z(), 3)
              << " mm to the left, back and head, turned by "
              << number_text(degrees(found->rotation_rad.x()), 3) << ", "
              << number_text(degrees(found->rotation_rad.y()), 3) << ", "
              << number_text(degrees(found->rotation_rad.z()), 3) << " degrees about these\n";
  }
  if (error) {
    std::cout << "  the path is " << number_text(error->spread_mm.mean, 3) << " +- "
              << number_text(error->spread_mm.deviation, 3) << " mm from the measured places, at most "
              << number_text(error->spread_mm.greatest, 3) << " mm, at " << error->times_s.size()
              << " moments\n";
  }
  return kDone;
}

}  // namespace

void add_sim_overlay_command(Command& sim) {
  Command& command = sim.add_command("overlay", "a computed radiograph over a real one, aligned with it");
  const auto request = std::make_shared<Request>();
  add_drr_options(command, request->drr);
  command.required_option("-r,--radiograph", "FILE", request->radiograph,
                          "the real one: DICOM, .png or .mha");
  command.choice("--polarity", {"bone-white", "bone-black"}, request->polarity, "of the radiograph",
                 "a DICOM file's own, else bone-white");
  command.flag("--align", request->align, "moves the patient as a rigid body until both are most alike");
  command.option("--aligned-geometry", "FILE", request->aligned,
                 "writes what --align found, as a geometry (.json)");
  command.choice("--mode", {"opacity", "difference", "checkerboard", "contour", "beside"}, request->mode,
                 "how both are shown", "opacity");
  command.option("--opacity", "PART", request->opacity, "of the DRR, 0 to 1", "0.5");
  command.option("--outline", "REGION", request->outline, "draws the edge of a region of the mesh (yellow)");
  command.option("--path", "CSV", request->path, "draws where a tumour goes (red): time_s,x_mm,y_mm,z_mm");
  command.option("--measured", "CSV", request->measured, "draws where it was seen (green): the same columns");
  command.option("--error-plot", "SVG", request->plot,
                 "how far the path is from what was measured, over time");
  command.required_option("-o,--output", "FILE", request->output, "where to (.png)");
  command.flag("--force", request->force, "replaces the files");
  command.explain(
      "The radiograph has as many pixels as the geometry says. A DICOM file says itself what is light; a "
      ".png "
      "or .mha is light where much attenuates, or dark with --polarity bone-black. An RT Image may be the "
      "geometry, too. How alike both are is told as gradient correlation, 1 at best, before and after "
      "--align, which finds some 20 mm and 10 degrees; one view shows least how far away the patient is. In "
      "a "
      "difference orange is where the DRR is lighter, blue where the radiograph is.");
  command.example("kiroku sim overlay ct/ -g front.json -r xray.png --align --mode contour -o contour.png",
                  "edges of the aligned DRR on the radiograph");
  command.example("kiroku sim overlay ct/ -g portal.dcm -r portal.dcm --align --mode difference -o moved.png",
                  "how the patient lay under a linear accelerator, by its own RT Image");
  command.example(
      "kiroku sim overlay ct/ -g front.json -r xray.png --mesh lung.msh --displacement "
      "breathing/frames/00018.vtu "
      "--outline 2 --path breathing/tumour.csv --mode beside -o both.png",
      "tumour and path on both");
  command.example(
      "kiroku sim overlay ct/ -g front.json -r xray.png --path breathing/tumour.csv --measured seen.csv "
      "--error-plot error.svg -o path.png",
      "how far the path is from the measured one");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

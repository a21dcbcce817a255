// 'kiroku sim overlay': a computed radiograph over a real one.
#include <filesystem>
#include <iostream>
#include <memory>
#include <numbers>
#include <optional>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/kiroku/output_file.h"
#include "apps/sim/frame_series.h"
#include "apps/sim/overlay_request.h"
#include "apps/sim/patient_of_material.h"
#include "apps/sim/radiograph_series.h"
#include "apps/sim/sim_command.h"
#include "base/error.h"
#include "base/number_text.h"
#include "sim/drr/overlay.h"
#include "sim/drr/registration.h"
#include "sim/model/body_model.h"

namespace kiroku::apps {

sim::OverlayMode mode_of(const OverlayRequest& request) {
  const std::string name = request.mode.value_or("opacity");
  if (name == "difference") return sim::OverlayMode::kDifference;
  if (name == "checkerboard") return sim::OverlayMode::kCheckerboard;
  if (name == "contour") return sim::OverlayMode::kContour;
  if (name == "beside") return sim::OverlayMode::kBeside;
  if (name == "wipe") return sim::OverlayMode::kWipe;
  return sim::OverlayMode::kOpacity;
}

double opacity_of(const OverlayRequest& request) {
  constexpr double kUsual = 0.5;
  const double opacity = request.opacity ? parse_number(*request.opacity, "--opacity") : kUsual;
  if (!(opacity >= 0 && opacity <= 1))
    throw UsageError("--opacity is " + *request.opacity + "; it must be from 0 to 1");
  return opacity;
}

void draw_on_both(sim::ColourPicture& picture, const std::vector<sim::PixelLine>& lines,
                  const sim::Colour& colour, std::size_t columns) {
  sim::draw(picture, lines, colour);
  if (picture.columns > columns) sim::draw(picture, lines, colour, double(columns));
}

std::optional<std::int32_t> outlined_region(const OverlayRequest& request, const sim::TetMesh& mesh) {
  if (!request.outline) return std::nullopt;
  const double number = parse_number(*request.outline, "--outline");
  const std::vector<std::int32_t> regions = sim::regions_of(mesh);
  std::string known;
  for (const std::int32_t region : regions) {
    if (double(region) == number) return region;
    known += (known.empty() ? "" : ", ") + std::to_string(region);
  }
  throw UsageError("--outline is '" + *request.outline + "', no region of the mesh; it has " + known);
}

namespace {

constexpr double kMmPerM = 1000;

void check(const OverlayRequest& request) {
  if (request.radiograph.has_value() == request.series.has_value())
    throw UsageError(
        "say what lies below: --radiograph (one picture) or --radiographs (several), one of them");
  if (request.radiograph) {
    if (request.frames || request.rate || request.start || request.seen || request.table || request.repeat)
      throw UsageError("--frames, --rate, --start, --seen, --table and --repeat are of --radiographs");
    if (std::filesystem::path(request.output).extension() != ".png")
      throw UsageError("--output is '" + request.output + "': its ending must be .png");
    refuse_to_replace(request.output, request.force);
  }
  if (request.plot && std::filesystem::path(*request.plot).extension() != ".svg") {
    throw UsageError("--error-plot is '" + *request.plot + "': its ending must be .svg");
  }
  if (request.plot && !(request.path && (request.measured || request.seen))) {
    throw UsageError(std::string("--error-plot shows how far --path is from --measured") +
                     (request.series ? " or --seen" : "") + ": give both");
  }
  if (request.aligned && !request.align)
    throw UsageError("--aligned-geometry is what --align finds: give both");
  if (request.outline && !request.drr.mesh)
    throw UsageError("--outline names a region of a mesh: give --mesh too");
  if (request.opacity && request.mode.value_or("opacity") != "opacity") {
    throw UsageError("--opacity is of --mode opacity");
  }
  if (request.plot) refuse_to_replace(*request.plot, request.force);
  if (request.aligned) refuse_to_replace(*request.aligned, request.force);
}

int run(const OverlayRequest& request) {
  check(request);
  if (request.series) return overlay_series(request);
  const double opacity = opacity_of(request);
  const sim::ProjectionImage radiograph = read_radiograph(*request.radiograph, request.polarity);
  std::optional<sim::TimedPath> path, measured;
  if (request.path) path = sim::read_timed_path(*request.path);
  if (request.measured) measured = sim::read_timed_path(*request.measured);
  auto line = std::make_optional<StepLine>();
  const DrrScene scene(request.drr, *line);
  const std::optional<std::int32_t> region = outlined_region(request, scene.deformed_mesh());
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
  sim::ColourPicture picture = sim::overlay_of(radiograph, drr, mode_of(request), opacity);
  if (region) {
    draw_on_both(picture, sim::outline_of(scene.deformed_mesh(), *region, geometry), kOutlineColour,
                 drr.columns);
  }
  if (path) draw_on_both(picture, sim::path_of(path->points_m, geometry), kPathColour, drr.columns);
  if (measured)
    draw_on_both(picture, sim::path_of(measured->points_m, geometry), kMeasuredColour, drr.columns);
  std::optional<PositionError> error;
  if (path && measured) error = error_of(*path, *measured, geometry.source_m(), *request.measured);
  OutputFile output(request.output);
  output.write(sim::png_of(picture));
  output.commit(OutputFile::Durability::kEventually);
  if (request.plot) write_text_file(*request.plot, plot_of(*error));
  if (request.aligned) write_text_file(*request.aligned, sim::geometry_json(geometry));

  const auto degrees = [](double radians) { return radians * 180 / std::numbers::pi; };
  std::vector<std::string> findings = scene.findings();
  if (auto warning =
          patient_warning(patients_of_ct(request.drr.volume.path, request.drr.volume.options().series),
                          "the radiograph", patients_of_radiographs(*request.radiograph)))
    findings.push_back(std::move(*warning));
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
    object["findings"] = findings;
    print_json(object);
    return kDone;
  }
  for (const std::string& finding : findings) print_error("kiroku", "warning: " + finding);
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
  const auto request = std::make_shared<OverlayRequest>();
  add_drr_options(command, request->drr);
  command.option("-r,--radiograph", "FILE", request->radiograph, "the real one: DICOM, .png or .mha");
  command.option("--radiographs", "PATH", request->series,
                 "several real ones: a folder of such files, a DICOM file of several pictures, or a film");
  command.choice("--polarity", {"bone-white", "bone-black"}, request->polarity, "of the radiograph",
                 "a DICOM file's own, else bone-white");
  command.flag("--align", request->align, "moves the patient as a rigid body until both are most alike");
  command.option("--aligned-geometry", "FILE", request->aligned,
                 "writes what --align found, as a geometry (.json)");
  command.choice("--mode", {"opacity", "difference", "checkerboard", "contour", "beside", "wipe"},
                 request->mode, "how both are shown", "opacity");
  command.option("--opacity", "PART", request->opacity, "of the DRR, 0 to 1; of a wipe its part of the width",
                 "0.5");
  command.option("--outline", "REGION", request->outline, "draws the edge of a region of the mesh (yellow)");
  command.option("--path", "CSV", request->path, "draws where a tumour goes (red): time_s,x_mm,y_mm,z_mm");
  command.option("--measured", "CSV", request->measured, "draws where it was seen (green): the same columns");
  command.option("--error-plot", "SVG", request->plot,
                 "how far the path is from what was measured, over time");
  command.option("--frames", "DIR", request->frames,
                 "of a series: how the mesh moves, what sim respire wrote");
  command.flag("--repeat", request->repeat, "of a series: the frames, and --path, are one breath of many");
  command.option("--rate", "N", request->rate, "of a series: pictures a second", "its own; 10 of a folder");
  command.option("--start", "S", request->start,
                 "of a series: the moment of --frames and --path at the first picture", "0");
  command.option("--seen", "CSV", request->seen,
                 "of a series: where the tumour is on its pictures: time_s,column,row");
  command.option("--table", "CSV", request->table, "of a series: likeness and errors of each picture");
  command.required_option("-o,--output", "FILE", request->output,
                          "where to: .png; of a series .mp4, .mkv or a folder for PNG files");
  command.flag("--force", request->force, "replaces the files");
  command.explain(
      "The radiograph has as many pixels as the geometry says. A DICOM file says itself what is light; a "
      ".png "
      "or .mha is light where much attenuates, or dark with --polarity bone-black. An RT Image may be the "
      "geometry, too. How alike both are is told as gradient correlation, 1 at best, before and after "
      "--align, which finds some 20 mm and 10 degrees; one view shows least how far away the patient is. In "
      "a "
      "difference orange is where the DRR is lighter, blue where the radiograph is.");
  command.explain(
      "A series becomes a film. --align is done on its first picture, and so are the windows of grey. Times "
      "of "
      "--measured and --seen are those of the pictures, the first at 0 s; those of --frames and --path may "
      "begin elsewhere (--start). A cross marks where the tumour is in each picture: red of --path, green of "
      "--measured and --seen. The table has a line a picture: its time, gradient correlation, the error in "
      "space and across the ray (--measured), and as it was seen, at the tumour's depth (--seen).");
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
  command.example(
      "kiroku sim overlay ct/ -g front.json --radiographs fluoroscopy.dcm --mesh lung.msh --frames breathing "
      "--repeat "
      "--path breathing/tumour.csv --seen seen.csv --table error.csv --mode difference -o overlay.mp4",
      "a breathing lung over a fluoroscopy, with the tumour's error in each picture");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

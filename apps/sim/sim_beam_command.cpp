// 'kiroku sim beam': what it takes to follow a tumour with a beam.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/sim/drr_request.h"
#include "apps/sim/frame_series.h"
#include "apps/sim/number_option.h"
#include "apps/sim/sim_command.h"
#include "base/error.h"
#include "base/number_text.h"
#include "sim/respiration/beam_tracking.h"
#include "sim/respiration/line_plot.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

constexpr double kMmPerM = 1000, kMlPerM3 = 1e6, kMsPerS = 1000;

struct Request {
  std::string path, output;
  std::optional<std::string> repeat_for, rate, latencies, margins, volumes, excursions, duty, field_latency,
      gantry, source_axis, isocenter, limit;
  bool force = false, json = false;
};

std::vector<double> list_of(const std::optional<std::string>& text, const std::string& usual,
                            const std::string& what, double least, double greatest) {
  const std::string& given = text ? *text : usual;
  std::vector<double> numbers =
      parse_numbers(given, ',', static_cast<std::size_t>(std::ranges::count(given, ',')) + 1, what);
  for (const double number : numbers) {
    if (!(number >= least && number <= greatest)) {
      throw UsageError(what + " holds " + number_text(number) + "; each must be from " + number_text(least) +
                       " to " + number_text(greatest));
    }
  }
  return numbers;
}

double number_of(const std::optional<std::string>& text, double usual, const std::string& what, double least,
                 double greatest) {
  return text ? parse_number(*text, what, least, greatest) : usual;
}

/// How the head turns over the path.
struct Gimbals {
  std::vector<sim::GimbalAngles> angles;
  sim::GimbalAngles least, greatest;
  double fastest_deg_s = 0;
};

Gimbals gimbals_of(const sim::BeamHead& head, const sim::SampledPath& path) {
  Gimbals gimbals;
  for (const sim::Vector3& place : path.points_m) {
    const sim::GimbalAngles now = sim::gimbal_angles(head, place);
    if (gimbals.angles.empty()) {
      gimbals.least = gimbals.greatest = now;
    } else {
      const sim::GimbalAngles& before = gimbals.angles.back();
      gimbals.fastest_deg_s =
          std::max(gimbals.fastest_deg_s,
                   std::hypot(now.pan_deg - before.pan_deg, now.tilt_deg - before.tilt_deg) / path.step_s);
    }
    gimbals.least = {std::min(gimbals.least.pan_deg, now.pan_deg),
                     std::min(gimbals.least.tilt_deg, now.tilt_deg)};
    gimbals.greatest = {std::max(gimbals.greatest.pan_deg, now.pan_deg),
                        std::max(gimbals.greatest.tilt_deg, now.tilt_deg)};
    gimbals.angles.push_back(now);
  }
  return gimbals;
}

double furthest_deg(const Gimbals& gimbals) {
  return std::max({std::abs(gimbals.least.pan_deg), std::abs(gimbals.least.tilt_deg),
                   std::abs(gimbals.greatest.pan_deg), std::abs(gimbals.greatest.tilt_deg)});
}

std::string angles_csv(const Gimbals& gimbals, const sim::SampledPath& path, double begins_s) {
  std::string text = "time_s,x_mm,y_mm,z_mm,pan_deg,tilt_deg\n";
  for (std::size_t at = 0; at < gimbals.angles.size(); ++at) {
    const sim::Vector3 mm = kMmPerM * path.points_m[at];
    text += number_text(begins_s + double(at) * path.step_s, 9) + "," + number_text(mm.x(), 7) + "," +
            number_text(mm.y(), 7) + "," + number_text(mm.z(), 7) + "," +
            number_text(gimbals.angles[at].pan_deg, 6) + "," + number_text(gimbals.angles[at].tilt_deg, 6) +
            "\n";
  }
  return text;
}

std::string latency_csv(const std::vector<sim::LatencyError>& errors) {
  std::string text =
      "latency_ms,delayed_mean_mm,delayed_95_mm,delayed_greatest_mm,predicted_mean_mm,predicted_95_mm,"
      "predicted_greatest_mm\n";
  for (const sim::LatencyError& error : errors) {
    text += number_text(kMsPerS * error.latency_s, 6);
    for (const sim::Spread& spread : {error.delayed_mm, error.predicted_mm}) {
      text += "," + number_text(spread.mean, 5) + "," + number_text(spread.percentile_95, 5) + "," +
              number_text(spread.greatest, 5);
    }
    text += "\n";
  }
  return text;
}

std::string latency_plot(const std::vector<sim::LatencyError>& errors) {
  sim::LinePlot plot{"How far the beam is from the tumour", "latency, ms", "mm, 95 % of the time within", {}};
  sim::PlotLine delayed{"where it was", {}, {}}, predicted{"where it is predicted to be", {}, {}};
  for (const sim::LatencyError& error : errors) {
    for (sim::PlotLine* line : {&delayed, &predicted}) line->x.push_back(kMsPerS * error.latency_s);
    delayed.y.push_back(error.delayed_mm.percentile_95);
    predicted.y.push_back(error.predicted_mm.percentile_95);
  }
  plot.lines = {std::move(delayed), std::move(predicted)};
  return sim::plot_svg(plot);
}

/// A field of a tumour, a motion and a margin.
struct FieldRow {
  double excursion_mm = 0, volume_ml = 0, margin_mm = 0;
  sim::BeamFields fields;
};

std::string fields_csv(const std::vector<FieldRow>& rows) {
  std::string text =
      "excursion_mm,tumour_ml,margin_mm,covering_ml,gating_ml,following_ml,following_of_covering,duty,"
      "covering_covered,gating_covered,following_covered\n";
  for (const FieldRow& row : rows) {
    const sim::BeamFields& f = row.fields;
    const std::vector<double> numbers{row.excursion_mm,
                                      row.volume_ml,
                                      row.margin_mm,
                                      kMlPerM3 * f.covering_m3,
                                      kMlPerM3 * f.gating_m3,
                                      kMlPerM3 * f.following_m3,
                                      f.following_m3 / f.covering_m3,
                                      f.duty,
                                      f.covering_covered,
                                      f.gating_covered,
                                      f.following_covered};
    for (std::size_t i = 0; i < numbers.size(); ++i) text += (i == 0 ? "" : ",") + number_text(numbers[i], 5);
    text += "\n";
  }
  return text;
}

nlohmann::ordered_json json_of(const sim::Spread& spread) {
  return {{"mean", spread.mean}, {"percentile_95", spread.percentile_95}, {"greatest", spread.greatest}};
}

nlohmann::ordered_json json_of(const FieldRow& row) {
  const sim::BeamFields& f = row.fields;
  return {{"excursion_mm", row.excursion_mm},
          {"tumour_ml", row.volume_ml},
          {"margin_mm", row.margin_mm},
          {"covering_ml", kMlPerM3 * f.covering_m3},
          {"gating_ml", kMlPerM3 * f.gating_m3},
          {"following_ml", kMlPerM3 * f.following_m3},
          {"following_of_covering", f.following_m3 / f.covering_m3},
          {"duty", f.duty},
          {"covering_covered", f.covering_covered},
          {"gating_covered", f.gating_covered},
          {"following_covered", f.following_covered}};
}

void print_latencies(const std::vector<sim::LatencyError>& errors) {
  std::cout << "  latency   beam where the tumour was      beam where it is predicted to be\n"
               "            mean mm   95 % within mm       mean mm   95 % within mm\n";
  for (const sim::LatencyError& error : errors) {
    std::printf("  %4.0f ms   %7.2f   %14.2f       %7.2f   %14.2f\n", kMsPerS * error.latency_s,
                error.delayed_mm.mean, error.delayed_mm.percentile_95, error.predicted_mm.mean,
                error.predicted_mm.percentile_95);
  }
  std::fflush(stdout);
}

/// The part of the whole-path field that a beam needs that follows, of each motion, at one margin.
void print_fields(const std::vector<FieldRow>& rows, const std::vector<double>& volumes_ml) {
  std::cout << "  field of a beam that follows, of one that covers the whole path (%)\n"
               "  excursion mm  margin mm";
  for (const double volume : volumes_ml) std::printf("  %7s ml", number_text(volume, 4).c_str());
  std::printf("\n");
  for (std::size_t at = 0; at < rows.size(); at += volumes_ml.size()) {
    std::printf("  %12s  %9s", number_text(rows[at].excursion_mm, 3).c_str(),
                number_text(rows[at].margin_mm, 3).c_str());
    for (std::size_t i = 0; i < volumes_ml.size(); ++i) {
      const sim::BeamFields& f = rows[at + i].fields;
      std::printf("  %10.0f", 100 * f.following_m3 / f.covering_m3);
    }
    std::printf("\n");
  }
  std::fflush(stdout);
}

int run(const Request& request) {
  constexpr double kMostRate = 1000, kMostRepeatS = 3600;
  const double rate = number_of(request.rate, 50, "--rate", 1, kMostRate);
  std::optional<double> repeat_s;
  if (request.repeat_for) repeat_s = parse_seconds(*request.repeat_for, "--repeat-for", 1, kMostRepeatS);
  const std::vector<double> latencies_ms =
      list_of(request.latencies, "100,200,300,400,500", "--latency", 1, 2000);
  const std::vector<double> margins_mm = list_of(request.margins, "2,4,6,8", "--margin", 0, 100);
  const std::vector<double> volumes_ml = list_of(request.volumes, "1,3,10,30", "--volume", 0.001, 10000);
  std::vector<double> excursions_mm;
  if (request.excursions) excursions_mm = list_of(request.excursions, "", "--excursion", 0.1, 100);
  sim::BeamFieldTerms terms;
  terms.duty = number_of(request.duty, 0.3, "--duty", 0.01, 1);
  terms.latency_s = number_of(request.field_latency, 300, "--field-latency", 1, 2000) / kMsPerS;
  const double limit_deg = number_of(request.limit, 2.5, "--gimbal-limit", 0.01, 45);

  const fs::path folder = request.output;
  const std::vector<fs::path> files{folder / "angles.csv", folder / "latency.csv", folder / "latency.svg",
                                    folder / "fields.csv"};
  for (const fs::path& file : files) refuse_to_replace(file.string(), request.force);

  const sim::TimedPath path = sim::read_timed_path(request.path);
  const sim::SampledPath places = sim::sampled(path, rate, repeat_s);
  sim::BeamHead head;
  head.source_axis_m = number_of(request.source_axis, 1000, "--source-axis", 100, 10000) / kMmPerM;
  head.gantry_deg = number_of(request.gantry, 0, "--gantry", -360, 360);
  if (request.isocenter) {
    const std::vector<double> mm = parse_numbers(*request.isocenter, ',', 3, "--isocenter");
    head.isocenter_m = sim::Vector3(mm[0], mm[1], mm[2]) / kMmPerM;
  } else {
    head.isocenter_m.setZero();
    for (const sim::Vector3& place : places.points_m)
      head.isocenter_m += place / double(places.points_m.size());
  }
  const Gimbals gimbals = gimbals_of(head, places);
  std::vector<sim::LatencyError> errors;
  for (const double latency_ms : latencies_ms)
    errors.push_back(sim::latency_error(places, latency_ms / kMsPerS));
  const double own_mm = kMmPerM * sim::excursion_m(places);
  if (excursions_mm.empty()) excursions_mm = {own_mm};
  std::vector<FieldRow> rows;
  for (const double excursion : excursions_mm) {
    const sim::SampledPath moved = request.excursions ? sim::scaled_to(places, excursion / kMmPerM) : places;
    for (const double margin : margins_mm) {
      for (const double volume : volumes_ml) {
        terms.margin_m = margin / kMmPerM;
        terms.tumour_m3 = volume / kMlPerM3;
        rows.push_back({excursion, volume, margin, sim::beam_fields(moved, terms)});
      }
    }
  }

  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed) throw IoError("create", folder, failed.value());
  write_text_file(files[0], angles_csv(gimbals, places, path.times_s.front()));
  write_text_file(files[1], latency_csv(errors));
  write_text_file(files[2], latency_plot(errors));
  write_text_file(files[3], fields_csv(rows));
  const double duration_s = double(places.points_m.size() - 1) * places.step_s;
  std::vector<std::string> findings;
  if (furthest_deg(gimbals) > limit_deg) {
    findings.push_back("the gimbals would have to turn by " + number_text(furthest_deg(gimbals), 3) +
                       " degrees, beyond their " + number_text(limit_deg) +
                       "; look at the isocentre (--isocenter), or the limit (--gimbal-limit)");
  }
  if (request.json) {
    nlohmann::ordered_json latencies = nlohmann::ordered_json::array(),
                           fields = nlohmann::ordered_json::array();
    for (const sim::LatencyError& error : errors) {
      latencies.push_back({{"latency_ms", kMsPerS * error.latency_s},
                           {"delayed_mm", json_of(error.delayed_mm)},
                           {"predicted_mm", json_of(error.predicted_mm)}});
    }
    for (const FieldRow& row : rows) fields.push_back(json_of(row));
    print_json({{"folder", request.output},
                {"places", places.points_m.size()},
                {"duration_s", duration_s},
                {"excursion_mm", own_mm},
                {"gimbals",
                 {{"pan_deg", {gimbals.least.pan_deg, gimbals.greatest.pan_deg}},
                  {"tilt_deg", {gimbals.least.tilt_deg, gimbals.greatest.tilt_deg}},
                  {"fastest_deg_s", gimbals.fastest_deg_s}}},
                {"latencies", latencies},
                {"fields", fields},
                {"findings", findings}});
    return kDone;
  }
  for (const std::string& finding : findings) print_error("kiroku", "warning: " + finding);
  std::cout << printable(request.output) << ": " << places.points_m.size() << " places over "
            << number_text(duration_s, 4) << " s, the tumour moves by " << number_text(own_mm, 3)
            << " mm\n  gimbals: aside " << number_text(gimbals.least.pan_deg, 3) << " to "
            << number_text(gimbals.greatest.pan_deg, 3) << " degrees, towards the head "
            << number_text(gimbals.least.tilt_deg, 3) << " to " << number_text(gimbals.greatest.tilt_deg, 3)
            << " degrees, at most " << number_text(gimbals.fastest_deg_s, 3) << " degrees/s\n";
  print_latencies(errors);
  print_fields(rows, volumes_ml);
  return kDone;
}

}  // namespace

void add_sim_beam_command(Command& sim) {
  Command& command =
      sim.add_command("beam", "a beam that follows a tumour: angles, errors by latency, fields it spares");
  const auto request = std::make_shared<Request>();
  command.argument("PATH", request->path,
                   "where the tumour is: time_s,x_mm,y_mm,z_mm, as sim respire writes it");
  command.required_option("-o,--output", "DIR", request->output, "where the tables go");
  command.option("--repeat-for", "TIME", request->repeat_for,
                 "the path is one breath, which follows itself for so long", "the path as it is");
  command.option("--rate", "HZ", request->rate, "how often the tumour is seen", "50");
  command.option("--latency", "MS,MS,...", request->latencies, "between seeing and moving",
                 "100,200,300,400,500");
  command.option("--margin", "MM,MM,...", request->margins, "of the fields, around the tumour", "2,4,6,8");
  command.option("--volume", "ML,ML,...", request->volumes, "of the tumour, a ball", "1,3,10,30");
  command.option("--excursion", "MM,MM,...", request->excursions,
                 "the same path made larger or smaller, between its two places that are furthest apart",
                 "its own");
  command.option("--duty", "PART", request->duty, "of the time that a gate is open", "0.3");
  command.option("--field-latency", "MS", request->field_latency,
                 "of gate and beam, where coverage is judged", "300");
  command.option("--gantry", "DEGREES", request->gantry, "where the head stands", "0");
  command.option("--source-axis", "MM", request->source_axis, "from the source to the isocentre", "1000");
  command.option("--isocenter", "X,Y,Z", request->isocenter, "in the patient, mm", "the middle of the path");
  command.option("--gimbal-limit", "DEGREES", request->limit, "that the head can turn by", "2.5");
  command.flag("-f,--force", request->force, "replaces the tables of an earlier run");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "Writes DIR/angles.csv (how the head turns), latency.csv and latency.svg (how far the beam is from the "
      "tumour, "
      "without prediction and with it), fields.csv (tissue in fields that cover the whole path, gate, or "
      "follow; and "
      "how much of the tumour they met). A place is predicted from the last second, by what was learnt from "
      "earlier "
      "ones; the first 10 s are not judged. Fields are planned on the first half of the path and judged on "
      "the "
      "second, so that breaths that change count. It plans nothing for a patient: it tells what tracking is "
      "worth.");
  command.example("kiroku sim beam breathing/tumour.csv --repeat-for 60s -o beam",
                  "of the breath of a lung model");
  command.example("kiroku sim beam measured.csv --excursion 2,5,10,15,20 -o beam",
                  "of a measured path, as if the tumour went less or further");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

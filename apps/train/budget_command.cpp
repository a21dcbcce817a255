#include <chrono>
#include <iostream>
#include <map>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "apps/common/time_option.h"
#include "apps/sim/number_option.h"
#include "apps/train/output_folder.h"
#include "apps/train/train_command.h"
#include "base/error.h"
#include "base/number_text.h"
#include "sim/haptics/haptic_rate.h"
#include "trainer/haptic_rate/rate_budget.h"
#include "trainer/report/plot.h"
#include "trainer/results/training_database.h"

namespace kiroku::apps {
namespace {

using Json = nlohmann::ordered_json;

struct Request {
  std::string output, seconds = "2";
  std::optional<std::string> database;
  bool force = false, json = false;
};

/// Mean thresholds by fingers: of the database's sessions, and where it has none the haptic-rate study's.
struct Required {
  std::map<std::size_t, double> hz;
  std::string from = "the haptic-rate study";
};

Required required_of(const Request& request) {
  Required required;
  for (std::size_t fingers = 1; fingers <= trainer::kMostFingers; ++fingers)
    required.hz[fingers] = sim::haptic_rate_hz(fingers);
  if (!request.database) return required;
  if (!std::filesystem::exists(*request.database))
    throw UsageError("there is no database " + *request.database + ": 'kiroku train haptic-rate' makes one");
  std::map<std::size_t, std::vector<double>> found;
  bool simulated = false;
  for (const trainer::RateSession& session : trainer::TrainingDatabase(*request.database).rate_sessions()) {
    simulated = simulated || session.simulated;
    for (const trainer::RateThreshold& threshold : session.thresholds)
      found[threshold.fingers.count()].push_back(threshold.estimate.hz);
  }
  if (found.size() < trainer::kMostFingers)
    throw UsageError(*request.database +
                     " has no thresholds for some of 1 to 5 fingers: 'kiroku train haptic-rate "
                     "--database' adds them");
  for (const auto& [fingers, hz] : found) required.hz[fingers] = trainer::summary_of(hz).mean;
  required.from = *request.database + (simulated ? " (simulated subjects among them)" : "");
  return required;
}

int run(const Request& request) {
  const double seconds = parse_seconds(request.seconds, "--seconds", 0.1, 60);
  const Required required = required_of(request);
  const OutputFolder folder(request.output, {"budget.csv", "budget.svg", "budget.pdf"}, request.force);
  StepLine line;
  line.show("making the plate");
  const trainer::Plate plate;
  sim::SurfaceRenderer renderer(plate.body().mesh(), sim::GpuUse::kOff);
  std::string csv =
      "fingers,required_hz,paper_required_hz,force_ms,achievable_hz,forces_hz,deformations_hz,pictures_hz,"
      "late_forces,paper_"
      "force_ms,"
      "paper_achievable_hz\n";
  Json rows = Json::array();
  std::string text =
      "  fingers  required   forces alone         in one thread: forces, deformations, pictures a second   "
      "exclusion study\n";
  trainer::PlotSeries needed{"required: " + required.from, {}, {}, {}, true},
      needed_then{"required: the exclusion study (from 3 fingers on a third each)", {}, {}, {}, true},
      here{"this machine", {}, {}, {}, true}, then{"the exclusion study's machine", {}, {}, {}, true};
  for (const auto& [fingers, hz] : required.hz) {
    line.show("measuring " + std::to_string(fingers) + " of 5");
    const trainer::RateBudget found = trainer::measure_budget(
        plate, renderer, fingers, hz, std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * seconds)));
    const double paper_ms = trainer::paper_force_ms(fingers);
    const sim::ScheduleReport& schedule = found.schedule;
    const double paper_hz = trainer::exclusion_required_hz(fingers);
    csv += std::to_string(fingers) + "," + number_text(hz) + "," + number_text(paper_hz) + "," +
           number_text(found.force_ms) + "," + number_text(found.achievable_hz) + "," +
           number_text(schedule.forces.rate_hz) + "," + number_text(schedule.deformation.rate_hz) + "," +
           number_text(schedule.pictures.rate_hz) + "," + std::to_string(schedule.late_forces) + "," +
           number_text(paper_ms) + "," + number_text(1000 / paper_ms) + "\n";
    rows.push_back({{"fingers", fingers},
                    {"required_hz", hz},
                    {"paper_required_hz", paper_hz},
                    {"force_ms", found.force_ms},
                    {"achievable_hz", found.achievable_hz},
                    {"forces_hz", schedule.forces.rate_hz},
                    {"deformations_hz", schedule.deformation.rate_hz},
                    {"pictures_hz", schedule.pictures.rate_hz},
                    {"late_forces", schedule.late_forces},
                    {"paper_force_ms", paper_ms},
                    {"paper_achievable_hz", 1000 / paper_ms}});
    text += "  " + std::to_string(fingers) + "        " + number_text(hz, 3) + " Hz   " +
            number_text(found.force_ms, 3) + " ms, " + number_text(found.achievable_hz, 3) + " Hz   " +
            number_text(schedule.forces.rate_hz, 3) + ", " + number_text(schedule.deformation.rate_hz, 3) +
            ", " + number_text(schedule.pictures.rate_hz, 3) + "   " + number_text(paper_ms, 3) + " ms, " +
            number_text(1000 / paper_ms, 3) + " Hz\n";
    const auto x = static_cast<double>(fingers);
    for (const auto& [series, y] :
         {std::pair(&needed, hz), std::pair(&needed_then, paper_hz), std::pair(&here, found.achievable_hz),
          std::pair(&then, 1000 / paper_ms)}) {
      series->x.push_back(x);
      series->y.push_back(y);
    }
  }
  const trainer::Plot plot{"Rate that is required, and that can be achieved",
                           "fingers",
                           "Hz",
                           {needed, needed_then, here, then},
                           true,
                           true,
                           "achieved: renewals of all fingers' forces, alone; the studies' objects differ"};
  folder.write("budget.csv", csv);
  folder.write("budget.svg", trainer::plot_file(plot, trainer::PlotForm::kSvg));
  folder.write("budget.pdf", trainer::plot_file(plot, trainer::PlotForm::kPdf));
  if (request.json) {
    print_json({{"folder", request.output}, {"required_from", required.from}, {"fingers", rows}});
  } else {
    std::cout << printable(request.output) << ": required rates of " << required.from << "\n" << text;
  }
  return kDone;
}

}  // namespace

void add_train_budget_command(Command& train) {
  Command& command = train.add_command("budget", "the rate that hands ask for, and what this machine gives");
  const auto request = std::make_shared<Request>();
  command.required_option("-o,--output", "DIR", request->output, "where to");
  command.option("--database", "FILE", request->database,
                 "takes the mean thresholds of the subjects in it, else the haptic-rate study's");
  command.option("--seconds", "T", request->seconds, duration_help("of each measurement"));
  command.flag("-f,--force", request->force, "replaces what an earlier run left in DIR");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "The more fingers press, the lower the rate at which their forces are felt as continuous, and the more "
      "each "
      "renewal costs. Presses the plate of the experiment with one to five fingers, first for forces alone, "
      "then "
      "with one thread that renews forces at the required rate and spends the rest on deformation and "
      "pictures. "
      "Writes budget.csv, budget.svg and budget.pdf.");
  command.example("kiroku train budget -o budget", "with the haptic-rate study's thresholds");
  command.example("kiroku train budget --database rates/results.sqlite -o budget",
                  "with those that were found");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

// 'kiroku plan replay': a planned operation as a film.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <system_error>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/common/step_line.h"
#include "apps/sim/picture_options.h"
#include "apps/sim/plan_command.h"
#include "apps/sim/plan_reading.h"
#include "base/error.h"
#include "base/number_text.h"
#include "media/film_writer.h"
#include "sim/plan/plan_run.h"
#include "sim/render/lettering.h"
#include "sim/render/plan_pictures.h"
#include "sim/volume/volume_reader.h"

namespace kiroku::apps {
namespace {

struct Request {
  std::string plan, output;
  std::optional<std::string> volume, series, stress;
  PictureOptions picture;
  bool force = false, json = false, no_caption = false, no_contacts = false;
};

/// A picture a time step, shown as fast as it was planned.
media::FilmFormat format_of(const sim::Plan& plan, const sim::Scene& scene) {
  media::FilmFormat format{scene.width, scene.height, 3, 1000, 1000};
  format.rate_denominator = static_cast<int>(std::lround(plan.time_step_s * 1000));
  return format;
}

/// "step 2 of 5: retract forceps", as of the frame.
std::string step_text(const sim::Plan& plan, const sim::PlanFrame& frame) {
  if (frame.time_s == 0) return plan.name;
  return "step " + std::to_string(frame.step + 1) + " of " + std::to_string(plan.steps.size()) + ": " +
         sim::title_of(plan, plan.steps[frame.step]);
}

std::string time_text(double time_s) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f s", time_s);
  return text;
}

class Replay {
 public:
  Replay(const Request& request, const sim::Plan& plan, const sim::Volume& volume)
      : request_(request),
        plan_(plan),
        pictures_(plan,
                  std::make_shared<const sim::ShadedVolume>(
                      sim::shade(volume, sim::extent_of(plan.body.mesh), request.picture.shading())),
                  request.picture.transfer_function("liver"), request.picture.engine_choice(),
                  request.picture.scene(sim::view_of_plan(plan), plan.body.mesh), options_of(request)),
        film_(request.output, format_of(plan, pictures_.scene()), request.force),
        largest_pa_(options_of(request).largest_pa) {
    if (!request.no_caption || request.stress) lettering_.emplace();
  }

  void add(const sim::PlanRun& run) {
    const sim::PlanFrame& frame = run.frame();
    sim::Picture picture = pictures_.picture(frame, run.mesh());
    if (!request_.no_caption)
      sim::draw_caption(*lettering_, picture, step_text(plan_, frame), time_text(frame.time_s));
    if (largest_pa_) sim::draw_stress_scale(*lettering_, picture, *largest_pa_);
    film_.add(apps::view_of(picture));
  }

  void finish() { film_.finish(); }
  [[nodiscard]] const sim::VolumeRenderer& renderer() const { return pictures_.renderer(); }
  [[nodiscard]] std::uint64_t frames() const { return film_.frames(); }

 private:
  static sim::PlanPictureOptions options_of(const Request& request) {
    sim::PlanPictureOptions options;
    options.contacts = !request.no_contacts;
    if (request.stress) options.largest_pa = parse_number(*request.stress, "--stress", 1e-9, 1e12);
    return options;
  }

  const Request& request_;
  const sim::Plan& plan_;
  sim::PlanPictures pictures_;
  media::FilmWriter film_;
  std::optional<double> largest_pa_;
  std::optional<sim::Lettering> lettering_;
};

/// Whether a CT is shown that the plan does not name.
bool is_of_another_file(const Request& request, const sim::Plan& plan) {
  std::error_code unknown;
  return request.volume &&
         (plan.volume.empty() || !std::filesystem::equivalent(*request.volume, plan.volume, unknown));
}

sim::VolumeFile read_ct(const Request& request, const sim::Plan& plan) {
  const std::filesystem::path path = request.volume ? std::filesystem::path(*request.volume) : plan.volume;
  if (path.empty()) {
    throw UsageError(
        "the plan " + request.plan +
        " names no CT that could be shown: give its \"volume\" a file or folder, or name one with --volume");
  }
  StepLine line;
  line.show("reading the CT");
  // The plan was made on it as it lies: what is uneven or may be missing is told.
  return sim::read_volume(path, {request.series.value_or(""), true});
}

int run(const Request& request) {
  const auto plan = read_plan_and_tell(request.plan, request.json);
  if (!plan) return kRefused;
  const sim::VolumeFile ct = read_ct(request, *plan);
  warn_of_nodes_outside(plan->body.mesh, ct.volume.grid);
  Replay replay(request, *plan, ct.volume);
  if (is_of_another_file(request, *plan))
    print_error("kiroku", "warning: the CT shown is " + *request.volume + ", which is not the plan's");
  for (const std::string& finding : ct.findings) print_error("kiroku", "warning: the CT: " + finding);
  sim::PlanRun plan_run(*plan);
  Progress progress("replaying the plan");
  const double all_s = duration_s(*plan);
  while (plan_run.next()) {
    replay.add(plan_run);
    constexpr double kMillisecondsPerSecond = 1000;
    progress.update(static_cast<std::uint64_t>(plan_run.frame().time_s * kMillisecondsPerSecond),
                    static_cast<std::uint64_t>(all_s * kMillisecondsPerSecond));
  }
  progress.clear();
  replay.finish();
  if (!replay.renderer().notice().empty()) print_error("kiroku", "warning: " + replay.renderer().notice());
  if (request.json) {
    print_json({{"film", request.output},
                {"frames", replay.frames()},
                {"duration_s", all_s},
                {"ct_of_plan", !is_of_another_file(request, *plan)},
                {"renderer", replay.renderer().renderer()}});
  } else {
    std::cout << printable(request.output) << ": " << replay.frames() << " frames of "
              << number_text(all_s, 4) << " s, by " << printable(replay.renderer().renderer()) << "\n";
  }
  return kDone;
}

}  // namespace

void add_plan_replay_command(Command& plan) {
  Command& command = plan.add_command("replay", "shows a plan as a film of the CT");
  const auto request = std::make_shared<Request>();
  command.argument("PLAN", request->plan, "the plan (.json)");
  command.required_option("-o,--output", "OUT", request->output,
                          "where to: .mp4 (H.264), .mkv (FFV1, without loss), or a folder for PNG files");
  command.option("--volume", "CT", request->volume, "the CT to be shown", "the plan's");
  command.option("--series", "UID", request->series,
                 "of a folder with several series: its UID, or how that ends");
  command.option("--stress", "PA", request->stress,
                 "tints tissue by its von Mises stress; PA is what the last colour stands for");
  request->picture.add_to(command, "liver");
  command.flag("--no-caption", request->no_caption, "without step and time");
  command.flag("--no-contacts", request->no_contacts, "without the points where tools hold or press");
  command.flag("--force", request->force, "replaces a film, or a folder of pictures, that is there");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "A picture for each time step, shown as fast as it was planned. Without a graphics processor (--gpu "
      "off) "
      "the same plan gives the same "
      "frames every time; .mkv and PNG files keep them bit for bit.");
  command.example("kiroku plan replay liver.json -o liver.mp4", "a film for any player");
  command.example(
      "kiroku plan replay kidney.json --transfer kidney --view 250,0 --stress 4000 --gpu off -o kidney.mkv",
      "with its stress, always the same frames");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

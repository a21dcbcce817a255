// 'kiroku sim drr-film': radiographs of a CT that moves, as a film.
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/sim/drr_request.h"
#include "apps/sim/sim_command.h"
#include "base/error.h"
#include "base/number_text.h"
#include "media/film_writer.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

struct Request {
  DrrRequest drr;
  std::string frames, output;
  std::optional<std::string> rate, repeat, window, polarity;
  bool force = false;
};

/// What 'sim respire' and 'plan run' leave, in its order: DIR/frames/*.vtu, or those of the folder itself.
std::vector<fs::path> frames_of(const std::string& named) {
  const fs::path folder =
      fs::is_directory(fs::path(named) / "frames") ? fs::path(named) / "frames" : fs::path(named);
  std::vector<fs::path> frames;
  if (fs::is_directory(folder)) {
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().extension() == ".vtu") frames.push_back(entry.path());
    }
  }
  if (frames.empty()) {
    throw UsageError("--frames is '" + named +
                     "', where there is no .vtu: name the folder that sim respire or plan run wrote");
  }
  std::ranges::sort(frames);
  return frames;
}

std::vector<std::uint8_t> eight_bits(const sim::GreyPicture& picture) {
  constexpr unsigned kByte = 8;
  std::vector<std::uint8_t> samples(picture.values.size());
  std::ranges::transform(picture.values, samples.begin(),
                         [](std::uint16_t value) { return static_cast<std::uint8_t>(value >> kByte); });
  return samples;
}

int run(const Request& request) {
  constexpr std::size_t kMostRate = 240, kMostRepeats = 1000, kUsualRate = 10;
  if (!request.drr.mesh) throw UsageError("a film needs what moves: give --mesh");
  if (request.drr.displacement) throw UsageError("--displacement is of one picture; a film has --frames");
  const std::vector<fs::path> frames = frames_of(request.frames);
  const std::size_t rate = request.rate ? parse_count(*request.rate, "--rate", 1, kMostRate) : kUsualRate;
  const std::size_t repeats = request.repeat ? parse_count(*request.repeat, "--repeat", 1, kMostRepeats) : 1;
  std::optional<sim::Window> window;
  if (request.window) {
    const std::vector<double> bounds = parse_numbers(*request.window, ':', 2, "--window");
    window = {bounds[0], bounds[1]};
  }
  const sim::Polarity polarity =
      request.polarity == "bone-black" ? sim::Polarity::kBoneBlack : sim::Polarity::kBoneWhite;
  auto line = std::make_optional<StepLine>();
  DrrScene scene(request.drr, *line);
  line.reset();
  const sim::ProjectionGeometry& geometry = scene.machine().geometry;
  const std::size_t columns = geometry.columns(), rows = geometry.rows();
  media::FilmWriter film(request.output,
                         {static_cast<int>(columns), static_cast<int>(rows), 1, static_cast<int>(rate), 1},
                         request.force);
  // All of a breath is computed once, however often it is shown.
  std::vector<std::vector<std::uint8_t>> pictures;
  {
    Progress progress("projecting");
    const std::optional<sim::ProjectionImage> still = scene.still(geometry);
    for (const fs::path& frame : frames) {
      scene.move_to(frame);
      const sim::ProjectionImage image = sum_of(still, scene.moving(geometry));
      // One window for all, so that what changes is the patient.
      if (!window) window = sim::window_of(image, sim::Response::kFilm);
      pictures.push_back(eight_bits(sim::picture_of(image, sim::Response::kFilm, *window, polarity)));
      progress.update(pictures.size(), frames.size());
    }
    progress.clear();
  }
  for (std::size_t repeat = 0; repeat < repeats; ++repeat) {
    for (const std::vector<std::uint8_t>& samples : pictures)
      film.add({static_cast<int>(columns), static_cast<int>(rows), 1, samples});
  }
  film.finish();
  if (request.drr.volume.json) {
    print_json({{"file", request.output},
                {"columns", columns},
                {"rows", rows},
                {"pictures", film.frames()},
                {"pictures_a_second", rate},
                {"window", {window->low, window->high}},
                {"findings", scene.findings()}});
    return kDone;
  }
  for (const std::string& finding : scene.findings()) print_error("kiroku", "warning: " + finding);
  std::cout << printable(request.output) << ": " << film.frames() << " pictures of " << columns << " x "
            << rows << " pixels, " << rate << " a second; shown is from " << number_text(window->low, 4)
            << " to " << number_text(window->high, 4) << " of the line integrals\n";
  return kDone;
}

}  // namespace

void add_sim_drr_film_command(Command& sim) {
  Command& command = sim.add_command("drr-film", "radiographs of a CT that moves, as a film");
  const auto request = std::make_shared<Request>();
  add_drr_options(command, request->drr);
  command.required_option("--frames", "DIR", request->frames,
                          "how it moves: what sim respire or plan run wrote");
  command.option("--rate", "N", request->rate, "pictures a second", "10");
  command.option("--repeat", "N", request->repeat, "shows all of it so often", "1");
  command.option("--window", "LOW:HIGH", request->window, "what of the line integrals is shown",
                 "0.5 to 99.5 % of the patient in the first");
  command.choice("--polarity", {"bone-white", "bone-black"}, request->polarity, "of the pictures",
                 "bone-white");
  command.required_option("-o,--output", "OUT", request->output,
                          "where to: .mp4 (H.264), .mkv (FFV1, without loss), or a folder for PNG files");
  command.flag("--force", request->force, "replaces a film, or a folder of pictures, that is there");
  command.explain("The geometry and what is projected are those of 'kiroku sim drr'.");
  command.example(
      "kiroku sim drr-film ct/ --mesh lung.msh --frames breathing -g front.json --gantry 30 --repeat 3 -o "
      "breath.mp4",
      "three breaths from half in front");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

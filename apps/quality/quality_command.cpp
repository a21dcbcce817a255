#include "apps/quality/quality_command.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <set>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "apps/kiroku/told_to_end.h"
#include "apps/quality/coding_options.h"
#include "apps/quality/quality_results.h"
#include "apps/quality/study_command.h"
#include "apps/sim/number_option.h"
#include "base/error.h"
#include "media/output_file.h"
#include "media/output_folder.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

constexpr const char* kResults = "quality.json";

struct Request {
  std::vector<std::string> clips;
  CodingOptions coding;
  StretchOptions stretch;
  std::optional<std::string> output;
  std::string measured = "24", pictures = "1";
  bool force = false, json = false;
};

/// A clip's name as a part of file names, unlike those that are taken.
std::string prefix_of(const fs::path& clip, std::set<std::string>& taken) {
  std::string prefix;
  for (const char letter : clip.stem().string()) {
    const bool plain = (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
                       (letter >= '0' && letter <= '9') || letter == '_';
    prefix += plain ? letter : '-';
  }
  std::string name = prefix;
  for (int number = 2; !taken.insert(name).second; ++number) name = prefix + "-" + std::to_string(number);
  return name;
}

std::string why_kept(const fs::path& folder) {
  return fs::exists(folder / kResults)
             ? ""
             : "it has no " + std::string(kResults) + " and so is no earlier result";
}

void write(const media::OutputFolder& folder, const std::string& name, ByteView bytes) {
  media::OutputFile file(folder.path() / name, false);
  file.write(bytes);
  file.commit();
}

/// Draws what is done, and ends it where that was asked for.
class Watch {
 public:
  Watch(std::string clip, std::size_t codings) : clip_(std::move(clip)), codings_(codings) {}
  void operator()(const std::string& doing, std::uint64_t done, std::uint64_t total) {
    if (told_to_end()) throw Error("ended before all was measured: nothing was written");
    if (doing != doing_ && total > 0 && !doing_.empty()) ++step_;
    const std::uint64_t percent = total == 0 ? 0 : done * 100 / total;
    if (doing == doing_ && percent == percent_ && (total > 0 || done % kBetween != 0)) return;
    doing_ = doing;
    percent_ = percent;
    line_.show(clip_ + ": " + doing + ", " +
               (total == 0 ? std::to_string(done) : std::to_string(percent) + " %") + " (" +
               std::to_string(step_) + " of " + std::to_string(codings_) + " codings begun)");
  }

 private:
  static constexpr std::uint64_t kBetween = 25;
  const std::string clip_;
  const std::size_t codings_;
  std::size_t step_ = 0;
  std::string doing_;
  std::uint64_t percent_ = 0;
  StepLine line_;
};

int run(const Request& request) {
  const std::vector<recorder::Coding> codings = codings_of(request.coding, recorder::usual_codings());
  recorder::TrialOptions options;
  options.stretch = stretch_of(request.stretch);
  options.measured = parse_count(request.measured, "--measured", 1, 10'000);
  const std::size_t shown = parse_count(request.pictures, "--pictures", 0, 20);
  std::optional<media::OutputFolder> folder;
  if (request.output) {
    options.shown = shown;
    folder.emplace(*request.output, request.force, why_kept);
  }
  end_when_told();
  std::vector<ClipResult> results;
  std::set<std::string> taken;
  for (const std::string& clip : request.clips) {
    Watch watch(fs::path(clip).filename().string(), codings.size());
    options.progress = std::ref(watch);
    results.push_back({fs::path(clip).filename().string(), prefix_of(clip, taken),
                       recorder::try_codings(clip, codings, options)});
  }
  const nlohmann::ordered_json all = quality_json(results);
  if (folder) {
    write(*folder, kResults,
          bytes_of(all.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n"));
    for (const ClipResult& clip : results) {
      for (const NamedPlot& plot : quality_plots(clip)) write(*folder, plot.name, plot.svg);
    }
    write(*folder, "quality.pdf", quality_pdf(results));
    write(*folder, "quality.html", bytes_of(quality_page(results)));
    folder->commit();
  }
  if (request.json) {
    print_json(all);
    return kDone;
  }
  for (const ClipResult& clip : results) std::cout << quality_text(clip) << "\n";
  if (request.output) {
    std::cout << "Pictures side by side are in "
              << printable((fs::path(*request.output) / "quality.html").string())
              << ", to be opened in a browser.\n";
  }
  return kDone;
}

}  // namespace

void add_quality_command(Command& program) {
  Command& command = program.add_command("quality", "says what each way of coding leaves of a clip");
  const auto request = std::make_shared<Request>();
  command.arguments("CLIP", request->clips, "a film, best of pictures that were never compressed");
  command.option("-o,--output", "FOLDER", request->output,
                 "a folder for quality.html, quality.json, quality.pdf and plots (SVG)");
  add_coding_options(command, request->coding);
  add_stretch_options(command, request->stretch);
  command.option("--measured", "N", request->measured,
                 "pictures, evenly spread, of which all is measured; PSNR and SSIM are of every picture");
  command.option("--pictures", "N", request->pictures,
                 "pictures in quality.html: the one with the most fine texture, then others with less");
  command.flag("--force", request->force, "replaces an earlier result in FOLDER");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "Without --coding and --rate: every profile of Kiroku, MPEG-2 from 1 to 15 Mbit/s (4:2:0) and to 25 "
      "(4:2:2), H.264 and H.265. Kiroku's own are coded as 'kiroku record' codes them, x264 and x265 with "
      "the "
      "preset 'medium'.");
  command.explain(
      "PSNR and SSIM are FFmpeg's, MS-SSIM is that of Wang, Simoncelli and Bovik (2003), colour errors are "
      "CIEDE2000. Fine texture is the share of the original's energy in patterns of about four pixels, "
      "within "
      "lit tissue, that comes back in phase. 'false' is energy there that the original does not have.");
  command.explain(
      "Everything is relative to the clip: what its own compression has lost is missing before. No figure "
      "says "
      "what a surgeon can judge. The clip is decoded in a process without keys and files.");
  command.example("kiroku quality laparoscopy.mkv", "a table of twenty codings");
  command.example("kiroku quality laparoscopy.mkv emr.mkv -o quality --pictures 3",
                  "two clips beside each other, with three pictures each to be looked at");
  command.example(
      "kiroku quality emr.mkv --from 2:00 --duration 10s --coding mpeg2 --rate 4M --rate 6M --json",
      "ten seconds by two rates, for another program");
  command.on_run([request] { return run(*request); });
  add_study_command(command);
}

}  // namespace kiroku::apps

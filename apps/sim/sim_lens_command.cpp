// 'kiroku sim lens': the lens of an endoscope from pictures of a chessboard.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/common/time_option.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/output_file.h"
#include "apps/sim/drr_request.h"
#include "apps/sim/number_option.h"
#include "apps/sim/sim_command.h"
#include "archive/reading/case_reader.h"
#include "base/error.h"
#include "base/number_text.h"
#include "sim/align/lens_calibrator.h"
#include "sim/align/lens_file.h"
#include "sim/drr/picture.h"
#include "viewer/compare/comparison.h"
#include "viewer/playback/picture_span.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct Request {
  std::vector<std::string> sources;
  std::string board, output;
  std::optional<std::string> stream, from, to, home;
  std::vector<std::string> identities;
  bool force = false, json = false;
};

/// What became of the pictures that were looked at.
struct Looked {
  std::vector<std::string> used;
  std::size_t without_board = 0, alike = 0;

  void take(sim::LensCalibrator::Taken taken, const std::string& name) {
    using Taken = sim::LensCalibrator::Taken;
    if (taken == Taken::kUsed) used.push_back(name);
    without_board += taken == Taken::kNoBoard ? 1 : 0;
    alike += taken == Taken::kAlike ? 1 : 0;
  }
};

sim::LensCalibrator calibrator_of(const std::string& board) {
  const std::vector<double> corners = parse_numbers(board, 'x', 2, "--board");
  constexpr double kMost = 1000;
  if (!std::ranges::all_of(corners,
                           [](double one) { return one == std::floor(one) && std::abs(one) < kMost; }))
    throw UsageError("--board is '" + board + "': these must be whole numbers, as 9x6 of 10 x 7 squares");
  return {static_cast<int>(corners[0]), static_cast<int>(corners[1])};
}

bool is_png(const std::string& source) {
  std::string ending = fs::path(source).extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return ending == ".png";
}

void take_files(const Request& request, sim::LensCalibrator& calibrator, Looked& looked) {
  Progress progress("looking for the board");
  for (std::size_t i = 0; i < request.sources.size(); ++i) {
    const std::string& file = request.sources[i];
    const sim::GreyPicture picture = sim::read_png(file);
    std::vector<std::uint8_t> grey;
    constexpr unsigned kByte = 8;
    for (const std::uint16_t value : picture.values)
      grey.push_back(static_cast<std::uint8_t>(value >> kByte));
    try {
      looked.take(calibrator.take(static_cast<int>(picture.columns), static_cast<int>(picture.rows), grey),
                  file);
    } catch (const UsageError& error) {
      throw UsageError(file + ": " + error.what());
    }
    progress.update(i + 1, request.sources.size());
  }
}

/// Luma of BT.601; what a converter of colours made of a grey picture is grey.
std::vector<std::uint8_t> grey_of(const std::vector<std::uint8_t>& rgb) {
  std::vector<std::uint8_t> grey;
  grey.reserve(rgb.size() / 3);
  for (std::size_t i = 0; i + 2 < rgb.size(); i += 3)
    grey.push_back(
        static_cast<std::uint8_t>((299U * rgb[i] + 587U * rgb[i + 1] + 114U * rgb[i + 2] + 500U) / 1000U));
  return grey;
}

void take_case(const Request& request, sim::LensCalibrator& calibrator, Looked& looked) {
  const std::optional<Home> home = Home::find(request.home);
  const archive::CaseReader recording = archive::CaseReader::open(find_case(home, request.sources.front()));
  const std::string stream = compare::pictures_of(recording, request.stream);
  const archive::Span stretch = recording.parse_stretch(request.from, request.to);
  const crypto::AgeIdentities identities = load_identities(request.identities, home);
  log_access(home, recording.folder(), "opened to calibrate a lens");
  playback::PictureSpan pictures(recording, identities, stream, stretch.start_ns, stretch.end_ns);
  Progress progress("looking for the board");
  // Some pictures a second: whoever moves a board by hand does not lay it elsewhere more often. More pictures
  // than that make a lens no better.
  constexpr std::int64_t kEveryNs = 400'000'000;
  constexpr std::size_t kMostUsed = 40;
  std::optional<std::int64_t> last_ns;
  while (calibrator.used() < kMostUsed && pictures.next() && pictures.time_ns() < stretch.end_ns) {
    const std::int64_t at_ns = pictures.time_ns();
    if (at_ns < stretch.start_ns || (last_ns && at_ns < *last_ns + kEveryNs)) continue;
    last_ns = at_ns;
    const std::vector<std::uint8_t> grey = grey_of(pictures.rgb());
    looked.take(calibrator.take(pictures.width(), pictures.height(), grey),
                archive::case_time_text(at_ns, recording.opening().begins_ns));
    progress.update(calibrator.used(), kMostUsed);
  }
}

void tell(const Request& request, const sim::LensCalibrator::Result& found, const Looked& looked) {
  const sim::Lens lens(found.lens);
  constexpr double kPercent = 100;
  if (request.json) {
    ordered_json used = ordered_json::array();
    for (std::size_t i = 0; i < looked.used.size(); ++i)
      used.push_back({{"picture", looked.used[i]}, {"error_px", found.error_px[i]}});
    print_json({{"output", request.output},
                {"width", found.lens.width},
                {"height", found.lens.height},
                {"error_px", found.rms_px},
                {"focal_error", found.focal_error},
                {"field_deg", lens.field_deg()},
                {"drawn_in", lens.drawn_in()},
                {"used", std::move(used)},
                {"without_board", looked.without_board},
                {"alike", looked.alike}});
    return;
  }
  std::vector<std::vector<std::string>> rows{{"picture", "off by"}};
  for (std::size_t i = 0; i < looked.used.size(); ++i)
    rows.push_back({printable(looked.used[i]), number_text(found.error_px[i], 2) + " pixels"});
  std::cout << format_table(rows, "lr", 2);
  std::cout << printable(request.output) << ": from " << counted(looked.used.size(), "picture", "pictures")
            << " of " << found.lens.width << "x" << found.lens.height << " pixels; " << looked.without_board
            << " did not show the whole board, " << looked.alike << " showed it as another one\n"
            << "  reprojection error " << number_text(found.rms_px, 3)
            << " pixels (root mean square); focal length known to "
            << number_text(kPercent * found.focal_error, 2) << " %\n  "
            << (lens.drawn_in() < 0 ? "pincushion" : "barrel") << " distortion of "
            << number_text(kPercent * std::abs(lens.drawn_in()), 2)
            << " % at the farthest corner, field of view " << number_text(lens.field_deg(), 3)
            << " degrees without it\n";
}

int run(const Request& request) {
  constexpr std::array<const char*, 4> kForms{".yml", ".yaml", ".xml", ".json"};
  const std::string form = fs::path(request.output).extension().string();
  if (std::ranges::find(kForms, form) == kForms.end())
    throw UsageError("--output is '" + request.output + "': its ending must be .yml, .yaml, .xml or .json");
  refuse_to_replace(request.output, request.force);
  sim::LensCalibrator calibrator = calibrator_of(request.board);
  Looked looked;
  if (std::ranges::all_of(request.sources, is_png)) {
    if (request.stream || request.from || request.to)
      throw UsageError("--stream, --from and --to are of a recorded case, not of pictures");
    take_files(request, calibrator, looked);
  } else if (request.sources.size() == 1) {
    take_case(request, calibrator, looked);
  } else {
    throw UsageError("name one recorded case, or pictures that all end in .png");
  }
  const sim::LensCalibrator::Result found = calibrator.solve();
  OutputFile file(request.output);
  file.write(bytes_of(sim::lens_calibration_text(found.lens, found.rms_px, looked.used.size(), form)));
  file.commit(OutputFile::Durability::kEventually);
  tell(request, found, looked);
  return kDone;
}

}  // namespace

void add_sim_lens_command(Command& sim) {
  Command& command = sim.add_command("lens", "calibrates an endoscope's lens with pictures of a chessboard");
  const auto request = std::make_shared<Request>();
  command.arguments("SOURCE", request->sources,
                    "a recorded case (folder, or identifier in the home's archive), or pictures (.png)");
  command.required_option(
      "--board", "COLUMNSxROWS", request->board,
      "the board's inner corners, of which each joins four squares: 9x6 of 10 x 7 squares");
  command.required_option("-o,--output", "FILE", request->output,
                          "where to (.yml, .yaml, .xml or .json), for kiroku compare --lens");
  command.option("--stream", "STREAM", request->stream, "of a case: which recorded pictures",
                 "endoscope, or the only ones");
  command.option("--from", "T", request->from, kTimeHelp, "the case's beginning");
  command.option("--to", "T", request->to, "likewise", "its end");
  command.option("-i,--identity", "FILE", request->identities,
                 "of a case: a recipient's identity; in a --demo home its own");
  add_home_option(command, request->home);
  command.flag("-f,--force", request->force, "replaces what is there");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "The file is one of OpenCV's FileStorage: camera_matrix, and k1, k2, p1, p2 and k3 of "
      "distortion_coefficients. At least eight pictures must show the whole board, tilted by 30 degrees to "
      "all "
      "sides, also in the picture's corners; of a case five pictures in two seconds are looked at until 40 "
      "are "
      "used. How large the squares are does not matter. Pictures that leave the lens open are refused. "
      "Record "
      "the board with the same endoscope, zoom, focus and recorder as the operation.");
  command.example("kiroku sim lens 20260805T074500Z-81d0c2aa --board 9x6 -o endoscope.yml",
                  "from a recording of the board");
  command.example("kiroku sim lens board-*.png --board 9x6 -o endoscope.yml", "from pictures");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

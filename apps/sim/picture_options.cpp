#include "apps/sim/picture_options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>

#include "apps/common/file.h"
#include "base/error.h"
#include "sim/align/lens_file.h"

namespace kiroku::apps {
namespace {

constexpr double kMetresPerMillimetre = 1e-3;

int parse_side(std::string_view text, const std::string& whole) {
  int side = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), side);
  constexpr int kLeast = 16, kGreatest = 8192;
  if (failure != std::errc() || end != text.data() + text.size() || side < kLeast || side > kGreatest)
    throw UsageError("--size is '" + whole +
                     "': it must be WIDTHxHEIGHT in pixels, each from 16 to 8192, such as 800x600");
  return side;
}

sim::Rgb parse_colour(const std::string& text) {
  if (text == "black") return {0, 0, 0};
  if (text == "white") return {255, 255, 255};
  unsigned value = 0;
  constexpr std::size_t kLength = 7;
  constexpr int kHexadecimal = 16;
  const auto [end, failure] = std::from_chars(text.data() + std::min<std::size_t>(1, text.size()),
                                              text.data() + text.size(), value, kHexadecimal);
  if (text.size() != kLength || text[0] != '#' || failure != std::errc() || end != text.data() + text.size())
    throw UsageError("--background is '" + text + "': it must be black, white or #rrggbb");
  return {static_cast<std::uint8_t>(value >> 16U), static_cast<std::uint8_t>(value >> 8U),
          static_cast<std::uint8_t>(value)};
}

/// Else it is coefficients.
bool is_lens_file(const std::string& lens) {
  const std::string ending = std::filesystem::path(lens).extension().string();
  return ending == ".yml" || ending == ".yaml" || ending == ".xml" || ending == ".json";
}

}  // namespace

void PictureOptions::add_to(Command& command, const std::string& default_transfer) {
  std::string names;
  for (const std::string& name : sim::transfer_function_names()) names += (names.empty() ? "" : ", ") + name;
  command.option("--transfer", "NAME", transfer,
                 "how tissue looks: " + names + ", or a file of your own (.json)", default_transfer);
  command.option("--view", "FROM", view,
                 "front, back, left, right, head, feet, or AZIMUTH,ELEVATION in degrees", "front");
  command.option("--at", "X,Y,Z", at, "what is in the picture's middle, in the patient's coordinates, mm",
                 "the mesh's middle");
  command.option("--zoom", "FACTOR", zoom, "larger than what fits", "1");
  command.option("--size", "WxH", size, "of the picture, in pixels", "800x600");
  command.option("--surface", "OPACITY", surface,
                 "shows the mesh's surface too, as a sheet of this opacity (0 to 1)");
  command.option("--background", "COLOUR", background, "black, white or #rrggbb",
                 "#121418; black with --endoscope");
  command.option("--spacing", "MM", spacing, "between cross-sections",
                 "half a voxel; with --endoscope 0.2 at most");
  command.option("--smooth", "MM", smooth, "smooths the CT first, against noise", "0");
  command.option(
      "--endoscope", "MM", endoscope,
      "looks through an endoscope, its tip so far from the tissue in the middle: a light at the tip "
      "that falls off, wet tissue, a lens that bends, a round picture");
  command.option("--field", "DEG", field, "that the endoscope shows, from border to border", "70");
  command.option(
      "--lens", "K1,K2|FILE", lens,
      "the endoscope's distortion, or its lens as 'kiroku sim lens' and OpenCV write it (.yml, .xml, "
      ".json)",
      "-0.25,0.05");
  add_engine_options(command, gpu, engine);
}

sim::TransferFunction PictureOptions::transfer_function(const std::string& by_default) const {
  return sim::find_transfer_function(transfer.value_or(by_default));
}

sim::EngineChoice PictureOptions::engine_choice() const { return apps::engine_choice(gpu, engine); }

sim::ShadingOptions PictureOptions::shading() const {
  sim::ShadingOptions options;
  if (smooth) options.smoothing_m = parse_number(*smooth, "--smooth", 0, 20) * kMetresPerMillimetre;
  options.gradient_smoothing_m = std::max(options.gradient_smoothing_m - options.smoothing_m, 0.0);
  return options;
}

sim::Endoscope PictureOptions::endoscope_asked() const {
  if (zoom) throw UsageError("--zoom is for pictures without an endoscope, which comes nearer (--endoscope)");
  sim::Endoscope asked;
  asked.distance_m = parse_number(*endoscope, "--endoscope", 5, 500) * kMetresPerMillimetre;
  if (lens && is_lens_file(*lens)) {
    if (field) throw UsageError("--field cannot be given beside --lens FILE, whose field it is");
    const Bytes text = read_small_file(*lens, "the lens");
    asked.calibration = sim::read_lens_calibration(text_of(text), *lens);
    return asked;
  }
  if (field) asked.field_deg = parse_number(*field, "--field", 20, 120);
  if (lens) {
    const std::vector<double> bend = parse_numbers(*lens, ',', 2, "--lens");
    asked.bend = {bend[0], bend[1]};
  }
  return asked;
}

sim::Scene PictureOptions::scene(sim::Ball ball, const sim::TetMesh& mesh,
                                 std::span<const double> displacement_m) const {
  sim::Scene scene;
  const std::string wanted = size.value_or("800x600");
  const std::size_t cross = std::min(wanted.find('x'), wanted.size());
  scene.width = parse_side(std::string_view(wanted).substr(0, cross), wanted);
  scene.height = parse_side(std::string_view(wanted).substr(std::min(cross + 1, wanted.size())), wanted);
  if (background) scene.background = parse_colour(*background);
  if (spacing) scene.spacing_m = parse_number(*spacing, "--spacing", 0.05, 20) * kMetresPerMillimetre;
  if (surface) {
    scene.surface.emplace();
    scene.surface->opacity = parse_number(*surface, "--surface", 0, 1);
  }
  if (at) {
    const std::vector<double> place = parse_numbers(*at, ',', 3, "--at");
    ball.centre_m = kMetresPerMillimetre * sim::Vector3(place[0], place[1], place[2]);
  }
  const double larger = zoom ? parse_number(*zoom, "--zoom", 0.1, 20) : 1;
  scene.camera = sim::camera_looking_at(ball, sim::view_direction(view.value_or("front")), scene.width,
                                        scene.height, larger);
  if (endoscope) {
    if (!background) scene.background = {0, 0, 0};
    const sim::Endoscope asked = endoscope_asked();
    try {
      sim::look_through(asked, mesh, displacement_m, scene);
    } catch (const sim::NoTissueOnAxis&) {
      throw;
    } catch (const UsageError& error) {
      if (!asked.calibration) throw;
      throw UsageError(*lens + ": " + error.what());
    }
  } else if (field || lens) {
    throw UsageError(std::string(field ? "--field" : "--lens") +
                     " says what an endoscope shows: give --endoscope MM too");
  }
  return scene;
}

void add_engine_options(Command& command, std::optional<std::string>& gpu,
                        std::optional<std::string>& engine) {
  command.choice("--gpu", {"auto", "off"}, gpu,
                 "auto takes a graphics processor where one is there; off computes pictures without one, the "
                 "same bytes everywhere",
                 "auto");
  command.choice(
      "--engine", {"auto", "opengl", "processor"}, engine,
      "opengl draws by OpenGL, also without a graphics processor (OSMesa); processor casts rays on "
      "the processor; auto is opengl on a graphics processor, else processor",
      "auto");
}

sim::EngineChoice engine_choice(const std::optional<std::string>& gpu,
                                const std::optional<std::string>& engine) {
  const std::string name = engine.value_or("auto");
  return {gpu.value_or("auto") == "off" ? sim::GpuUse::kOff : sim::GpuUse::kAuto,
          name == "opengl"      ? sim::Engine::kOpenGl
          : name == "processor" ? sim::Engine::kProcessor
                                : sim::Engine::kAuto};
}

media::PictureView view_of(const sim::Picture& picture) {
  return {picture.width, picture.height, 3, picture.rgb};
}

void warn_of_nodes_outside(const sim::TetMesh& mesh, const sim::Grid& grid) {
  const auto outside = std::ranges::count_if(mesh.nodes, [&](const sim::Vector3& node) {
    const sim::Vector3 index = grid.index(node);
    for (int axis = 0; axis < 3; ++axis) {
      if (index[axis] < -1 || index[axis] > double(grid.size[static_cast<std::size_t>(axis)])) return true;
    }
    return false;
  });
  if (outside > 0 && outside < static_cast<std::ptrdiff_t>(mesh.nodes.size())) {
    print_error("kiroku", "warning: " + std::to_string(outside) + " of the mesh's " +
                              std::to_string(mesh.nodes.size()) +
                              " nodes lie outside the CT, where there is taken to be air");
  }
}

}  // namespace kiroku::apps

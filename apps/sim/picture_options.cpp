#include "apps/sim/picture_options.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "base/error.h"

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

}  // namespace

void PictureOptions::add_to(Command& command, const std::string& default_transfer) {
  std::string names;
  for (const std::string& name : sim::transfer_function_names()) names += (names.empty() ? "" : ", ") + name;
  command.option("--transfer", "NAME", transfer,
                 "how tissue looks: " + names + ", or a file of your own (.json)", default_transfer);
  command.option("--view", "FROM", view,
                 "front, back, left, right, head, feet, or AZIMUTH,ELEVATION in degrees", "front");
  command.option("--zoom", "FACTOR", zoom, "larger than what fits", "1");
  command.option("--size", "WxH", size, "of the picture, in pixels", "800x600");
  command.option("--surface", "OPACITY", surface,
                 "shows the mesh's surface too, as a sheet of this opacity (0 to 1)");
  command.option("--background", "COLOUR", background, "black, white or #rrggbb", "#121418");
  command.option("--spacing", "MM", spacing, "between cross-sections", "half a voxel");
  command.option("--smooth", "MM", smooth, "smooths the CT first, against noise", "0");
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

sim::Scene PictureOptions::scene(const sim::Ball& ball) const {
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
  scene.camera = sim::camera_looking_at(ball, sim::view_direction(view.value_or("front")), scene.width,
                                        scene.height, zoom ? parse_number(*zoom, "--zoom", 0.1, 20) : 1);
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

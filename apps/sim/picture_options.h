// Options that all commands with shaded pictures share, and what they come to. Not thread-safe.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "apps/common/command_line.h"
#include "apps/sim/number_option.h"
#include "media/png.h"
#include "sim/render/endoscope.h"
#include "sim/render/volume_renderer.h"

namespace kiroku::apps {

struct PictureOptions {
  std::optional<std::string> transfer, view, at, zoom, size, surface, background, spacing, smooth, gpu,
      engine;
  std::optional<std::string> endoscope, field, lens;

  /// States them; `default_transfer` in words.
  void add_to(Command& command, const std::string& default_transfer);

  /// kiroku::UsageError that names the option, for values that are none.
  [[nodiscard]] sim::TransferFunction transfer_function(const std::string& by_default) const;
  [[nodiscard]] sim::EngineChoice engine_choice() const;
  [[nodiscard]] sim::ShadingOptions shading() const;
  /// Looks at the ball; an endoscope at the mesh, displaced (3 |V|, or empty for none).
  [[nodiscard]] sim::Scene scene(sim::Ball ball, const sim::TetMesh& mesh,
                                 std::span<const double> displacement_m = {}) const;

 private:
  [[nodiscard]] sim::Endoscope endoscope_asked() const;
};

/// States '--gpu' and '--engine'.
void add_engine_options(Command& command, std::optional<std::string>& gpu,
                        std::optional<std::string>& engine);
/// What they come to.
sim::EngineChoice engine_choice(const std::optional<std::string>& gpu,
                                const std::optional<std::string>& engine);

/// For media's writers; the picture must outlive it.
media::PictureView view_of(const sim::Picture& picture);

/// On standard error, where some of the nodes are; none inside is an error of shade().
void warn_of_nodes_outside(const sim::TetMesh& mesh, const sim::Grid& grid);

}  // namespace kiroku::apps

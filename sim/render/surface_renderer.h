// Shaded pictures of a deformed body by its surface, quick enough to be watched while it is pressed, and
// which pixels show what: for measuring what can be seen.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "sim/mesh/tet_mesh.h"
#include "sim/render/camera.h"
#include "sim/render/gl_context.h"
#include "sim/render/picture.h"
#include "sim/render/solid_shapes.h"

namespace kiroku::sim {

/// A tool, a landmark. Pixels that show it are counted under its mark; 0 is not told apart from the body.
struct MarkedSolid {
  Solid solid;
  std::uint8_t mark = 0;
  bool ghost = false;  // every other pixel is left out, so that what is behind it stays visible
};

struct SurfaceScene {
  Camera camera;
  int width = 640, height = 480;
  Rgb background{18, 20, 24};
  /// Towards the light, in the view's axes.
  Vector3 to_light{-0.5, 0.6, 1};
  Rgb tissue{176, 84, 72};
  std::vector<Rgb> node_colours;  // (|V|), instead of `tissue`; may be empty
  bool shows_body = true;
  std::vector<MarkedSolid> solids;
};

struct SurfacePicture {
  Picture picture;
  std::array<std::size_t, 256> pixels_of_mark{};  // that show a solid of each mark
};

/// Belongs to the thread that made it. In software the same input gives the same bytes.
class SurfaceRenderer {
 public:
  /// kiroku::Error as choose_context().
  SurfaceRenderer(
      const TetMesh& mesh, GpuUse use, const GpuMaker& make_gpu = [] { return make_gpu_context(); });
  ~SurfaceRenderer();
  SurfaceRenderer(const SurfaceRenderer&) = delete;
  SurfaceRenderer& operator=(const SurfaceRenderer&) = delete;

  /// `displacement_m`: (3 |V|), finite, or empty for none. kiroku::UsageError for pictures without pixels or
  /// larger than 8192 and for numbers of another count; kiroku::Error where the driver fails.
  SurfacePicture render(std::span<const double> displacement_m, const SurfaceScene& scene);

  /// As the driver names itself, and why no graphics processor is used where one failed; else empty.
  [[nodiscard]] const std::string& renderer() const;
  [[nodiscard]] const std::string& notice() const { return notice_; }

 private:
  class Drawing;
  std::string notice_;
  std::unique_ptr<Drawing> drawing_;
};

}  // namespace kiroku::sim

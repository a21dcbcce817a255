// Shaded pictures of a CT that is deformed and cut with a mesh. The CT is prepared once; a new picture costs
// the mesh's nodes and the rays. Two engines draw the same picture: OpenGL, and a ray caster on the processor
// (ray_caster.h).
//
// Source: section 3 of "Interactive Volume Manipulation for Supporting Preoperative Planning". The picture is
// defined by cross-sections of the displaced tetrahedra at multiples of `spacing_m` from the eye,
// perpendicular to the view. Tissue is where its initial coordinates find it in the CT. HU run straight along
// a ray from each cross-section to the next, from where it enters the mesh to the first, and from the last to
// where it leaves it or meets a tool. What such a segment shows and takes of the light is the transfer
// function's integral over it (preintegration.h). It is shaded by ambient, diffuse and specular (Blinn, 1977)
// light on the CT's gradient, the mean of those at its ends, turned by the rotations of the four nodes at its
// end. Rays gather segments from the nearest on, and end where less than half a step of 8 bits could still be
// added; tetrahedra in which no HU can be seen are passed over. Where a mesh overlaps itself, its layers are
// blended in the order they are entered, at most kMostLayers.
#pragma once

#include <memory>
#include <span>

#include "sim/render/gl_context.h"
#include "sim/render/ray_caster.h"
#include "sim/render/scene.h"
#include "sim/render/shaded_volume.h"
#include "sim/render/transfer_function.h"

namespace kiroku::sim {

enum class Engine {
  kAuto,       // OpenGL on a graphics processor where one may be used and works, else the processor
  kOpenGl,     // on a graphics processor where one may be used and works, else in software by OSMesa
  kProcessor,  // the ray caster
};

/// What is to compute pictures. `gpu` says whether a graphics processor may be used.
struct EngineChoice {
  // NOLINTNEXTLINE(google-explicit-constructor): most who choose only care for the first
  EngineChoice(GpuUse gpu_use = GpuUse::kAuto, Engine by = Engine::kAuto) : gpu(gpu_use), engine(by) {}
  GpuUse gpu;
  Engine engine;
};

/// Belongs to the thread that made it. Without a graphics processor the same input gives the same bytes,
/// whatever the number of threads.
class VolumeRenderer {
 public:
  static constexpr int kMostLayers = 12;

  /// kiroku::Error as choose_context() for Engine::kOpenGl, and for a CT that the engine cannot hold.
  VolumeRenderer(
      std::shared_ptr<const ShadedVolume> volume, const TransferFunction& transfer,
      const EngineChoice& choice, const GpuMaker& make_gpu = [] { return make_gpu_context(); });
  ~VolumeRenderer();
  VolumeRenderer(const VolumeRenderer&) = delete;
  VolumeRenderer& operator=(const VolumeRenderer&) = delete;

  /// The undeformed mesh; again when it was cut. kiroku::Error for one with a face of three tetrahedra, and
  /// where the transfer function hides all of it.
  void set_mesh(const TetMesh& rest);

  /// `displacement_m`: (3 |V|), finite, or empty for none. kiroku::UsageError for pictures without pixels or
  /// larger than 8192, for numbers of another count, and for a light or lens that is none; kiroku::Error
  /// where the driver fails. A graphics processor that fails is left for what comes without one, with a
  /// notice.
  Picture render(std::span<const double> displacement_m, const Scene& scene);

  /// As the driver names itself, or RayCaster::name().
  [[nodiscard]] const std::string& renderer() const;
  /// Why the graphics processor is not used, where one is there and failed; else empty.
  [[nodiscard]] const std::string& notice() const { return notice_; }

 private:
  class Drawing;

  Picture drawn(const Scene& scene);
  void start(std::unique_ptr<GlContext> context);
  void go_on_in_software(const std::string& why);
  [[nodiscard]] bool is_on_gpu() const;

  std::shared_ptr<const ShadedVolume> volume_;
  TransferFunction transfer_;
  Engine engine_;
  std::string notice_;
  std::unique_ptr<PlacedMesh> mesh_;
  // One of both.
  std::unique_ptr<Drawing> drawing_;
  std::unique_ptr<RayCaster> caster_;
};

/// Von Mises stress at the nodes: the mean of the tetrahedra around each, by their volume. (|V|), 0 for loose
/// nodes.
std::vector<double> at_nodes(const TetMesh& mesh, std::span<const double> of_tetrahedra);

}  // namespace kiroku::sim

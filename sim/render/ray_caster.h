// Shaded pictures of a deformed CT on the processor, without OpenGL: the picture that volume_renderer.h
// defines, of the same numbers. Tools, the tint by stress and the surface's sheet are drawn too.
//
// It differs from the OpenGL engine in two things. Where a cell of the CT (the room between the centres of
// eight texels) is so faint that no HU within it could take more than kFaint of the light over two, four or
// eight cross-sections, only every second, fourth or eighth of them is sampled there; where nothing within it
// can be seen, none. For this, cells are taken eight at a time. And pixels are cast where their neighbours
// differ: see kAlike.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/instruction_set.h"
#include "sim/render/picture.h"
#include "sim/render/placed_mesh.h"
#include "sim/render/preintegration.h"
#include "sim/render/ray_march.h"
#include "sim/render/scene.h"
#include "sim/render/shaded_volume.h"
#include "sim/render/transfer_function.h"

namespace kiroku::sim {

struct RayCasterOptions {
  unsigned threads = 0;  // 0: as many as the machine has
  InstructionSet instructions = best_instruction_set();
};

/// Belongs to the thread that made it. The same input gives the same bytes, whatever the number of threads
/// and the set of instructions.
class RayCaster {
 public:
  /// A share of the light; the second while a scene moves.
  static constexpr double kFaint = 0.02, kMovingFaint = 0.06;
  /// Of a light at the tip, where it is brightest: what is dark has finer steps there.
  static constexpr double kTipFaint = 0.005;
  /// Of 255: pixels between others that differ by no more are not cast. While a scene moves, every fourth
  /// pixel of every fourth row is cast first, else every second, where pixels are smaller than voxels.
  static constexpr double kAlike = 3, kMovingAlike = 11;
  /// What comes through a ray that counts as ended: less than half a step of 8 bits; by a light at the tip;
  /// and while a scene moves. What it would have met counts as what it has met.
  static constexpr double kEnded = 0.0019, kTipEnded = 1e-4, kMovingEnded = 0.02;

  /// kiroku::Error for a CT of 2^31 texels or more; kiroku::UsageError for instructions that are not there.
  RayCaster(std::shared_ptr<const ShadedVolume> volume, const TransferFunction& transfer,
            const RayCasterOptions& options = {});

  /// Of the mesh that is drawn from now on: what of it stays while it deforms.
  void set_mesh(const PlacedMesh& mesh);
  /// `mesh` is the one that was set, placed for the scene's camera; `spacing_m` more than 0. What the scene
  /// says is valid.
  Picture draw(const PlacedMesh& mesh, const Scene& scene, double spacing_m);

  /// "processor, 2 threads, AVX-512".
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  [[nodiscard]] static double faint_share(const PlacedMesh& mesh, const Scene& scene);
  void measure_opacity();
  [[nodiscard]] const Preintegration& segments_of(double length_mm, bool linear);
  void place_cells(const PlacedMesh& mesh, const Scene& scene);
  [[nodiscard]] MarchScene march_scene(const PlacedMesh& mesh, const Scene& scene, double spacing_m);

  std::shared_ptr<const ShadedVolume> volume_;
  TransferFunction transfer_;
  unsigned threads_;
  MarchRays march_;
  std::string name_;
  std::vector<std::uint8_t> opacity_;
  std::vector<float> tint_colours_, linear_tint_colours_;
  struct Table {
    bool linear;
    Preintegration segments;
  };
  std::vector<Table> tables_;  // the last ones that were used, the latest first
  std::vector<MarchCell> cells_;
};

}  // namespace kiroku::sim

// What the pixels of a picture meet, without a graphics library: the faces by which their rays enter a mesh,
// and tools, lit. Made for one picture; thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "sim/render/picture_triangles.h"
#include "sim/render/placed_mesh.h"
#include "sim/render/ray_march.h"

namespace kiroku::sim {

/// One square of the picture; see MarchTile, whose lists it has.
struct PictureSquare {
  static constexpr std::size_t kPixels = std::size_t{kMarchTile} * kMarchTile;
  static constexpr float kNothingMm = 1e30F;

  std::int32_t x0, y0, x1, y1;
  std::array<std::uint32_t, kPixels * kMarchLayers> entries;
  std::array<double, kPixels * kMarchLayers> depths_mm;
  std::array<std::uint8_t, kPixels> layers{};
  std::array<float, kPixels> end_mm;
  std::array<float, kPixels * 3> colour;
  std::array<float, kPixels * 2> slopes;  // where a lens bends the rays

  void enter(std::size_t pixel, std::uint32_t entry, double depth_mm);
};

class PictureSquares {
 public:
  /// Both must outlive it. The mesh's nodes are placed for the scene's camera.
  PictureSquares(const PlacedMesh& mesh, const Scene& scene);

  [[nodiscard]] std::size_t count() const {
    return static_cast<std::size_t>(across_) * static_cast<std::size_t>(down_);
  }
  /// Squares row by row.
  [[nodiscard]] std::unique_ptr<PictureSquare> square(std::size_t number) const;

 private:
  void find_faces(const PlacedMesh& mesh);
  void find_solids();
  [[nodiscard]] Vector3 colour_of(const PictureTriangle& triangle, const PictureTriangle::Hit& hit,
                                  const Eigen::Vector2d& ray) const;

  const Scene& scene_;
  PixelRays rays_;
  int across_, down_;
  Vector3 light_;
  std::vector<PictureTriangle> faces_, solids_;
  std::vector<std::array<Vector3, 3>> normals_;  // of the solids' triangles, by their number
  std::vector<Rgb> colours_;
  std::optional<TriangleTiles> face_tiles_, solid_tiles_;
};

}  // namespace kiroku::sim

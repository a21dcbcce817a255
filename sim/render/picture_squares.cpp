#include "sim/render/picture_squares.h"

#include <algorithm>
#include <cmath>

#include "sim/mesh/length_unit.h"
#include "sim/render/tip_lighting.h"

namespace kiroku::sim {

void PictureSquare::enter(std::size_t pixel, std::uint32_t entry, double depth_mm) {
  const std::size_t first = pixel * kMarchLayers;
  std::size_t at = layers[pixel];
  if (at == kMarchLayers) {
    if (depth_mm >= depths_mm[first + at - 1]) return;
    --at;
  } else {
    ++layers[pixel];
  }
  for (; at > 0 && depths_mm[first + at - 1] > depth_mm; --at) {
    entries[first + at] = entries[first + at - 1];
    depths_mm[first + at] = depths_mm[first + at - 1];
  }
  entries[first + at] = entry;
  depths_mm[first + at] = depth_mm;
}

PictureSquares::PictureSquares(const PlacedMesh& mesh, const Scene& scene)
    : scene_(scene),
      rays_(pixel_rays(scene)),
      across_((scene.width + kMarchTile - 1) / kMarchTile),
      down_((scene.height + kMarchTile - 1) / kMarchTile),
      light_(scene.to_light.normalized()) {
  find_faces(mesh);
  find_solids();
  face_tiles_.emplace(faces_, scene.width, scene.height, kMarchTile);
  solid_tiles_.emplace(solids_, scene.width, scene.height, kMarchTile);
}

void PictureSquares::find_faces(const PlacedMesh& mesh) {
  for (const EntryFace& face : mesh.topology.surface) {
    const std::array<Vector3, 3> corners{mesh.view_mm[face.nodes[0]], mesh.view_mm[face.nodes[1]],
                                         mesh.view_mm[face.nodes[2]]};
    if (std::optional<PictureTriangle> triangle = picture_triangle(corners, face.nodes, rays_)) {
      triangle->number = face.cell_and_corner;
      faces_.push_back(*triangle);
    }
  }
}

void PictureSquares::find_solids() {
  for (const Solid& solid : scene_.solids) {
    const std::vector<SolidVertex> vertices = triangles_of(solid);
    for (std::size_t at = 0; at < vertices.size(); at += 3) {
      std::array<Vector3, 3> places, turned;
      for (std::size_t corner = 0; corner < 3; ++corner) {
        places[corner] = kMmPerM * scene_.camera.view_m(vertices[at + corner].position_m);
        turned[corner] = scene_.camera.to_view * vertices[at + corner].normal;
      }
      // Their triangles are apart: pixels on an edge of two belong to both, and show the same.
      std::optional<PictureTriangle> triangle = picture_triangle(places, {0, 1, 2}, rays_);
      if (!triangle) continue;
      triangle->owns_edge = {true, true, true};
      triangle->number = static_cast<std::uint32_t>(normals_.size());
      solids_.push_back(*triangle);
      normals_.push_back(turned);
      colours_.push_back(solid.colour);
    }
  }
}

/// As the shader of solids has it.
Vector3 PictureSquares::colour_of(const PictureTriangle& triangle, const PictureTriangle::Hit& hit,
                                  const Eigen::Vector2d& ray) const {
  Vector3 n = Vector3::Zero();
  for (std::size_t corner = 0; corner < 3; ++corner)
    n += hit.shares[corner] * normals_[triangle.number][corner];
  n.normalize();
  const Vector3 to_eye =
      rays_.parallel ? Vector3(0, 0, 1) : Vector3(-ray.x(), -ray.y(), 1).normalized().eval();
  const Rgb& rgb = colours_[triangle.number];
  if (scene_.tip_light) {
    const Vector3 at_mm = rays_.parallel ? Vector3(ray.x(), ray.y(), -hit.depth_mm)
                                         : Vector3(hit.depth_mm * Vector3(ray.x(), ray.y(), -1));
    const TipRay tip = tip_ray(*scene_.tip_light, at_mm / kMmPerM);
    const double gloss =
        std::pow(std::max(n.dot((tip.to_light + to_eye).normalized()), 0.0), kSolidShininess);
    const Vector3 lit = linear_light(rgb) * (0.35 + 0.65 * std::max(n.dot(tip.to_light), 0.0)) +
                        Vector3::Constant(kSolidGloss * gloss);
    return (tip.brightness * lit).cwiseMin(1).unaryExpr(&encoded_light);
  }
  const double diffuse = std::max(n.dot(light_), 0.0);
  const double gloss = std::pow(std::max(n.dot((light_ + to_eye).normalized()), 0.0), kSolidShininess);
  return Vector3(rgb[0], rgb[1], rgb[2]) / 255 * (0.35 + 0.65 * diffuse) +
         Vector3::Constant(kSolidGloss * gloss);
}

std::unique_ptr<PictureSquare> PictureSquares::square(std::size_t number) const {
  auto made = std::make_unique<PictureSquare>();
  PictureSquare& square = *made;
  square.x0 = static_cast<std::int32_t>(number) % across_ * kMarchTile;
  square.y0 = static_cast<std::int32_t>(number) / across_ * kMarchTile;
  square.x1 = std::min(square.x0 + kMarchTile, scene_.width);
  square.y1 = std::min(square.y0 + kMarchTile, scene_.height);
  square.end_mm.fill(PictureSquare::kNothingMm);
  for (std::size_t i = 0; i < square.colour.size(); ++i)
    square.colour[i] = static_cast<float>(scene_.background[i % 3]) / 255;
  const auto number_of = [&](int x, int y) {
    return static_cast<std::size_t>((y - square.y0) * kMarchTile + x - square.x0);
  };
  const auto each_pixel = [&](const PictureTriangle& triangle, const auto& visit) {
    for (int y = std::max(triangle.y0, square.y0); y < std::min(triangle.y1, square.y1); ++y) {
      for (int x = std::max(triangle.x0, square.x0); x < std::min(triangle.x1, square.x1); ++x) {
        const Eigen::Vector2d ray = rays_.of(x, y);
        const auto hit = triangle.hit(ray.x(), ray.y());
        if (hit) visit(number_of(x, y), *hit, ray);
      }
    }
  };
  for (const std::uint32_t face : face_tiles_->of(number)) {
    each_pixel(faces_[face], [&](std::size_t pixel, const PictureTriangle::Hit& hit, const Eigen::Vector2d&) {
      square.enter(pixel, faces_[face].number, hit.depth_mm);
    });
  }
  for (const std::uint32_t at : solid_tiles_->of(number)) {
    const PictureTriangle& triangle = solids_[at];
    each_pixel(triangle, [&](std::size_t pixel, const PictureTriangle::Hit& hit, const Eigen::Vector2d& ray) {
      const bool before_the_eye = rays_.parallel || hit.depth_mm >= 1;
      if (!before_the_eye || hit.depth_mm >= double{square.end_mm[pixel]}) return;
      square.end_mm[pixel] = static_cast<float>(hit.depth_mm);
      const Vector3 colour = colour_of(triangle, hit, ray);
      for (std::size_t c = 0; c < 3; ++c)
        square.colour[3 * pixel + c] = static_cast<float>(colour[static_cast<Eigen::Index>(c)]);
    });
  }
  for (int y = square.y0; (scene_.lens || scene_.round) && y < square.y1; ++y) {
    for (int x = square.x0; x < square.x1; ++x) {
      const std::size_t pixel = number_of(x, y);
      if (scene_.round && is_beyond_disc(scene_.width, scene_.height, x, y)) square.layers[pixel] = 0;
      if (!scene_.lens) continue;
      for (std::size_t c = 0; c < 2; ++c)
        square.slopes[2 * pixel + c] =
            static_cast<float>(rays_.lens->slope(x, y)[static_cast<Eigen::Index>(c)]);
    }
  }
  return made;
}

}  // namespace kiroku::sim

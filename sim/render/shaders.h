// The shaders of volumes, as texts of GLSL 4.50. Pure, thread-safe.
#pragma once

#include <compare>
#include <string>

namespace kiroku::sim {

/// What a ray gathers. Each makes the shader longer, so it is only there where it is asked for.
struct RayFeatures {
  bool surface = false;  // the faces of the mesh's surface, as thin sheets
  bool stress = false;   // tissue is tinted by a number at the nodes
  bool tip = false;      // light as tip_lighting.h has it, and colours linear in light
  bool lens = false;     // rays bent by a lens, told for each pixel

  auto operator<=>(const RayFeatures&) const = default;
};

/// A triangle over the whole picture, without any input.
std::string whole_picture_vertex_shader();
/// Faces of the surface, for peeling.
std::string entry_vertex_shader();
/// Which face comes next behind the layer before.
std::string entry_fragment_shader();
/// Tools and points: opaque, lit.
std::string solid_vertex_shader();
std::string solid_fragment_shader(bool tip);
/// A body's surface with solids, lit; each pixel is told which solid's mark it shows.
std::string marked_vertex_shader();
std::string marked_fragment_shader();
/// Rays through tetrahedra, a pixel each: in whatever triangle covers them, or kRayGroup x kRayGroup at once.
std::string ray_fragment_shader(const RayFeatures& features);
std::string ray_compute_shader(const RayFeatures& features);
inline constexpr int kRayGroup = 8;
/// Packs a picture of RGBA, rows from below, into bytes of RGB, rows from the top: kPackGroup words of four
/// bytes at once, the groups in any number of rows.
std::string pack_compute_shader();
inline constexpr int kPackGroup = 64;

}  // namespace kiroku::sim

#include "sim/drr/gl_projector.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/LU>

#include "base/error.h"
#include "sim/mesh/length_unit.h"
#include "sim/mesh/mesh_topology.h"
#include "sim/render/gl_objects.h"
#include "sim/render/proxy_geometry.h"

namespace kiroku::sim {
namespace {

// All lengths in mm. The view's axes are those of the detector: a pixel at (s, t), each from -1 to 1, looks
// along (s, t, -1), whose length in the patient `metric` gives; -z is the depth.
constexpr const char* kVertex = R"GLSL(#version 450 core
layout(std430, binding = 0) readonly buffer Positions { vec4 positions[]; };
layout(std430, binding = 1) readonly buffer Tetrahedra { uvec4 tetrahedra[]; };
uniform vec4 depth;  // nearest and farthest
flat out uint cell;
// Opposite each corner the others, anticlockwise from outside.
const int kFaces[12] = int[12](1, 2, 3, 0, 3, 2, 0, 1, 3, 0, 2, 1);
void main() {
  cell = uint(gl_VertexID / 12);
  vec3 p = positions[tetrahedra[cell][kFaces[gl_VertexID % 12]]].xyz;
  float w = -p.z;
  gl_Position = vec4(p.xy, (w * (depth.y + depth.x) - 2 * depth.y * depth.x) / (depth.y - depth.x), w);
}
)GLSL";

constexpr const char* kFragment = R"GLSL(#version 450 core
struct Cell { vec4 barycentric[3]; vec4 texture[3]; };
layout(std430, binding = 2) readonly buffer Cells { Cell cells[]; };
layout(std430, binding = 3) readonly buffer Densities { float densities[]; };
layout(binding = 0) uniform sampler3D attenuation;
uniform vec4 picture;  // size, and one over it
uniform vec4 metric_s, metric_t, metric_middle;
uniform float spacing;
flat in uint cell;
layout(location = 0) out float integral;
void main() {
  vec2 s = gl_FragCoord.xy * picture.zw * 2 - 1;
  vec3 along = vec3(s, -1);
  vec4 row1 = cells[cell].barycentric[0], row2 = cells[cell].barycentric[1], row3 = cells[cell].barycentric[2];
  vec4 begin = vec4(1 - row1.w - row2.w - row3.w, row1.w, row2.w, row3.w);
  vec4 slope = vec4(0, dot(row1.xyz, along), dot(row2.xyz, along), dot(row3.xyz, along));
  slope.x = -slope.y - slope.z - slope.w;
  // A face along the ray: which side of it the ray is on was decided when the cell was drawn in this pixel.
  vec4 size = vec4(0, dot(abs(row1.xyz), abs(along)), dot(abs(row2.xyz), abs(along)), dot(abs(row3.xyz), abs(along)));
  size.x = size.y + size.z + size.w;
  vec4 least = size * 1e-5;
  vec4 crossing = -begin / slope;
  const vec4 far = vec4(1e30);
  vec4 leaving = mix(far, crossing, lessThan(slope, -least));
  vec4 coming = mix(-far, crossing, greaterThan(slope, least));
  float from = max(max(coming.x, coming.y), max(coming.z, coming.w));
  float to = min(min(leaving.x, leaving.y), min(leaving.z, leaving.w));
  // Beside the cell by rounding, or a cell without volume.
  if (!(from < to) || to >= 1e29 || from <= -1e29) discard;
  float way = (to - from) * length(metric_middle.xyz + s.x * metric_s.xyz + s.y * metric_t.xyz);
  float points = ceil(way / spacing);
  vec4 tex1 = cells[cell].texture[0], tex2 = cells[cell].texture[1], tex3 = cells[cell].texture[2];
  vec3 place = vec3(tex1.w, tex2.w, tex3.w);
  vec3 step = vec3(dot(tex1.xyz, along), dot(tex2.xyz, along), dot(tex3.xyz, along));
  float sum = 0;
  for (float point = 0.5; point < points; point += 1)
    sum += textureLod(attenuation, place + mix(from, to, point / points) * step, 0).x;
  integral = sum / points * way * densities[cell];
}
)GLSL";

using Float4 = std::array<float, 4>;

Float4 single(const Vector3& v, double fourth = 0) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z()),
          static_cast<float>(fourth)};
}

/// What OpenGL is given for one radiograph.
struct Frame {
  std::vector<Float4> positions;
  std::vector<CellGeometry> cells;
  std::vector<float> densities;  // (|T|), factors of the attenuation
  Vector3 along_s, along_t, middle;
  double nearest_mm = 0, farthest_mm = 0;
};

}  // namespace

class GlProjector::Drawing {
 public:
  Drawing(std::unique_ptr<GlContext> context, const Volume& volume, const Attenuation& attenuation,
          const TetMesh& mesh)
      : context_(std::move(context)),
        gl_(context_->gl()),
        program_(make_program(gl_, kVertex, kFragment)),
        vertex_array_(make_vertex_array(gl_)),
        volume_(make_texture(gl_, GL_TEXTURE_3D)),
        positions_(make_buffer(gl_)),
        tetrahedra_(make_buffer(gl_)),
        cells_(make_buffer(gl_)),
        densities_(make_buffer(gl_)),
        vertices_(static_cast<GLsizei>(12 * mesh.tetrahedra.size())) {
    fill_buffer<Tetrahedron>(gl_, tetrahedra_, mesh.tetrahedra);
    upload(volume, attenuation);
  }
  ~Drawing() {
    try {
      context_->make_current();  // to free what is in it
    } catch (const Error&) {     // the driver is gone, and all it had with it
    }
  }
  Drawing(const Drawing&) = delete;
  Drawing& operator=(const Drawing&) = delete;

  ProjectionImage draw(const Frame& frame, int columns, int rows, double spacing_m);
  [[nodiscard]] const GlContext& context() const { return *context_; }

 private:
  void upload(const Volume& volume, const Attenuation& attenuation);
  void set(const char* name, const Float4& value) {
    gl_.ProgramUniform4f(program_.name(), gl_.GetUniformLocation(program_.name(), name), value[0], value[1],
                         value[2], value[3]);
  }

  std::unique_ptr<GlContext> context_;
  const GlFunctions& gl_;
  GlHandle program_, vertex_array_, volume_, positions_, tetrahedra_, cells_, densities_;
  GLsizei vertices_;
};

void GlProjector::Drawing::upload(const Volume& volume, const Attenuation& attenuation) {
  GLint largest = 0;
  gl_.GetIntegerv(GL_MAX_3D_TEXTURE_SIZE, &largest);
  const std::array<std::size_t, 3>& size = volume.grid.size;
  if (*std::ranges::max_element(size) > static_cast<std::size_t>(largest)) {
    throw Error("the CT has more voxels along a side than " + context_->renderer() + " can hold (" +
                std::to_string(largest) + "); project it without a graphics processor");
  }
  std::vector<float> per_mm(volume.hu.size());
  std::ranges::transform(volume.hu, per_mm.begin(), [&](float hu) {
    return static_cast<float>(attenuation.per_m(double{hu}) / kMmPerM);
  });
  const auto side = [&](std::size_t axis) { return static_cast<GLsizei>(size[axis]); };
  gl_.TextureStorage3D(volume_.name(), 1, GL_R32F, side(0), side(1), side(2));
  gl_.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
  gl_.TextureSubImage3D(volume_.name(), 0, 0, 0, 0, side(0), side(1), side(2), GL_RED, GL_FLOAT,
                        per_mm.data());
  gl_.TextureParameteri(volume_.name(), GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  gl_.TextureParameteri(volume_.name(), GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  for (const GLenum axis : {GLenum{GL_TEXTURE_WRAP_S}, GLenum{GL_TEXTURE_WRAP_T}, GLenum{GL_TEXTURE_WRAP_R}})
    gl_.TextureParameteri(volume_.name(), axis, GL_CLAMP_TO_EDGE);
  check_gl(gl_, "give the CT to " + context_->renderer());
}

ProjectionImage GlProjector::Drawing::draw(const Frame& frame, int columns, int rows, double spacing_m) {
  context_->make_current();
  const GlHandle sum = make_texture(gl_, GL_TEXTURE_2D), target = make_framebuffer(gl_);
  gl_.TextureStorage2D(sum.name(), 1, GL_R32F, columns, rows);
  gl_.NamedFramebufferTexture(target.name(), GL_COLOR_ATTACHMENT0, sum.name(), 0);
  if (gl_.CheckNamedFramebufferStatus(target.name(), GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    throw Error(context_->renderer() + " cannot draw a radiograph of " + std::to_string(columns) + "x" +
                std::to_string(rows) + " pixels; make the detector coarser");
  }
  fill_buffer<Float4>(gl_, positions_, frame.positions);
  fill_buffer<CellGeometry>(gl_, cells_, frame.cells);
  fill_buffer<float>(gl_, densities_, frame.densities);
  set("depth", single(Vector3(frame.nearest_mm, frame.farthest_mm, 0)));
  const Vector3 size(columns, rows, 1.0 / columns);
  set("picture", single(size, 1.0 / rows));
  set("metric_s", single(frame.along_s));
  set("metric_t", single(frame.along_t));
  set("metric_middle", single(frame.middle));
  gl_.ProgramUniform1f(program_.name(), gl_.GetUniformLocation(program_.name(), "spacing"),
                       static_cast<float>(spacing_m * kMmPerM));
  gl_.BindVertexArray(vertex_array_.name());
  gl_.BindFramebuffer(GL_FRAMEBUFFER, target.name());
  gl_.Viewport(0, 0, columns, rows);
  constexpr std::array<float, 4> kNothing{};
  gl_.ClearNamedFramebufferfv(target.name(), GL_COLOR, 0, kNothing.data());
  gl_.UseProgram(program_.name());
  gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, positions_.name());
  gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 1, tetrahedra_.name());
  gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 2, cells_.name());
  gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 3, densities_.name());
  gl_.BindTextureUnit(0, volume_.name());
  gl_.Disable(GL_DEPTH_TEST);
  // One side of each cell, so that a pixel gets each cell once; which side does not matter.
  gl_.Enable(GL_CULL_FACE);
  gl_.CullFace(GL_BACK);
  gl_.Enable(GL_BLEND);
  gl_.BlendFunc(GL_ONE, GL_ONE);
  gl_.DrawArrays(GL_TRIANGLES, 0, vertices_);
  gl_.Disable(GL_BLEND);
  gl_.NamedFramebufferReadBuffer(target.name(), GL_COLOR_ATTACHMENT0);
  gl_.PixelStorei(GL_PACK_ALIGNMENT, 1);
  ProjectionImage image{static_cast<std::size_t>(columns), static_cast<std::size_t>(rows), {}};
  image.values.resize(image.columns * image.rows);
  gl_.ReadPixels(0, 0, columns, rows, GL_RED, GL_FLOAT, image.values.data());
  check_gl(gl_, "draw a radiograph with " + context_->renderer());
  // OpenGL counts rows from below.
  for (std::size_t row = 0; row < image.rows / 2; ++row) {
    const auto upper = image.values.begin() + static_cast<std::ptrdiff_t>(row * image.columns);
    const auto lower =
        image.values.begin() + static_cast<std::ptrdiff_t>((image.rows - 1 - row) * image.columns);
    std::swap_ranges(upper, upper + columns, lower);
  }
  return image;
}

GlProjector::GlProjector(const Volume& volume, const Attenuation& attenuation, TetMesh mesh, GpuUse use,
                         double spacing_m, const GpuMaker& make_gpu)
    : mesh_(std::move(mesh)), spacing_m_(spacing_m > 0 ? spacing_m : volume.grid.spacing_m.minCoeff() / 2) {
  const Grid& grid = volume.grid;
  for (const Vector3& node : mesh_.nodes) {
    Vector3 at = grid.index(node);
    for (int axis = 0; axis < 3; ++axis)
      at[axis] = (at[axis] + 0.5) / double(grid.size[static_cast<std::size_t>(axis)]);
    texture_.push_back(at);
  }
  ChosenContext chosen = choose_context(use, make_gpu);
  notice_ = chosen.notice;
  const bool software = chosen.context->is_software();
  try {
    drawing_ = std::make_unique<Drawing>(std::move(chosen.context), volume, attenuation, mesh_);
  } catch (const Error& error) {
    if (software) throw;
    notice_ =
        std::string("the graphics processor failed, radiographs are computed in software: ") + error.what();
    drawing_ = std::make_unique<Drawing>(make_software_context(), volume, attenuation, mesh_);
  }
}

GlProjector::~GlProjector() = default;

const std::string& GlProjector::renderer() const { return drawing_->context().renderer(); }

ProjectionImage GlProjector::inside(const ProjectionGeometry& geometry,
                                    std::span<const Vector3> displacement_m, DensityRule rule) {
  if (displacement_m.size() != mesh_.nodes.size()) {
    throw Error("a mesh of " + std::to_string(mesh_.nodes.size()) + " nodes was given " +
                std::to_string(displacement_m.size()) + " displacements");
  }
  const auto columns = double(geometry.columns()), rows = double(geometry.rows());
  const ProjectionGeometry::PixelRays& rays = geometry.pixel_rays();
  Frame frame;
  frame.along_s = rays.along_row * columns / 2;
  frame.along_t = -rays.down_column * rows / 2;
  frame.middle = rays.corner + rays.along_row * (columns - 1) / 2 + rays.down_column * (rows - 1) / 2;
  Eigen::Matrix3d axes;
  axes << frame.along_s, frame.along_t, -frame.middle;
  const Eigen::Matrix3d to_view = axes.inverse();
  std::vector<Vector3> moved(mesh_.nodes), view_mm(mesh_.nodes.size());
  frame.nearest_mm = std::numeric_limits<double>::infinity();
  const std::vector<bool> used = nodes_in_use(mesh_);
  for (std::size_t node = 0; node < moved.size(); ++node) {
    moved[node] += displacement_m[node];
    if (!moved[node].allFinite()) throw Error("displacements that are no numbers cannot be projected");
    view_mm[node] = kMmPerM * (to_view * (moved[node] - geometry.source_m()));
    frame.positions.push_back(single(view_mm[node], 1));
    if (!used[node]) continue;
    frame.nearest_mm = std::min(frame.nearest_mm, -view_mm[node].z());
    frame.farthest_mm = std::max(frame.farthest_mm, -view_mm[node].z());
  }
  constexpr double kLeastMm = 1;
  if (frame.nearest_mm < kLeastMm) {
    throw Error(
        "the X-ray source would be inside the mesh or beyond it: move the isocentre, or look at the "
        "displacement");
  }
  frame.nearest_mm -= kLeastMm / 2;
  frame.farthest_mm += kLeastMm;
  proxy_geometry(mesh_.tetrahedra, view_mm, texture_, frame.cells);
  frame.densities.assign(mesh_.tetrahedra.size(), 1);
  if (rule == DensityRule::kKeepMass) {
    const TetMesh deformed{moved, mesh_.tetrahedra, {}};
    for (std::size_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
      const double factor = std::abs(signed_volume_m3(mesh_, t) / signed_volume_m3(deformed, t));
      frame.densities[t] = std::isfinite(factor) ? static_cast<float>(factor) : 0;
    }
  }
  return drawing_->draw(frame, static_cast<int>(geometry.columns()), static_cast<int>(geometry.rows()),
                        spacing_m_);
}

}  // namespace kiroku::sim

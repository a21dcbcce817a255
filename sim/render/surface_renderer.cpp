#include "sim/render/surface_renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "sim/mesh/length_unit.h"
#include "sim/mesh/mesh_topology.h"
#include "sim/render/gl_objects.h"
#include "sim/render/gl_vector.h"
#include "sim/render/shaders.h"

namespace kiroku::sim {
namespace {

constexpr int kLargestSide = 8192;

/// As the shaders know it: positions and normals along the view's axes, mm.
struct Vertex {
  Float4 position;  // and the mark
  Float4 normal;    // and 1 for a ghost
  Float4 colour;
};

Float4 share_of(const Rgb& colour) { return single(Vector3(colour[0], colour[1], colour[2]) / 255, 1); }

}  // namespace

class SurfaceRenderer::Drawing {
 public:
  Drawing(std::unique_ptr<GlContext> context, const TetMesh& mesh)
      : context_(std::move(context)),
        gl_(context_->gl()),
        rest_m_(mesh.nodes),
        vertex_array_(make_vertex_array(gl_)),
        vertices_buffer_(make_buffer(gl_)),
        program_(make_program(gl_, marked_vertex_shader(), marked_fragment_shader())) {
    for (const Face& face : faces_of(mesh).surface) faces_.push_back(face.nodes);
  }
  ~Drawing() {
    try {
      context_->make_current();  // to free what is in it
    } catch (const Error&) {     // the driver is gone, and all it had with it
    }
  }
  Drawing(const Drawing&) = delete;
  Drawing& operator=(const Drawing&) = delete;

  SurfacePicture draw(std::span<const double> displacement_m, const SurfaceScene& scene);
  [[nodiscard]] const GlContext& context() const { return *context_; }
  [[nodiscard]] std::size_t nodes() const { return rest_m_.size(); }

 private:
  void add_body(std::span<const double> displacement_m, const SurfaceScene& scene);
  void add_solids(const SurfaceScene& scene);
  void resize(int width, int height);
  void set_uniforms(const SurfaceScene& scene);
  SurfacePicture read(int width, int height);

  std::unique_ptr<GlContext> context_;
  const GlFunctions& gl_;
  std::vector<Vector3> rest_m_;
  std::vector<std::array<std::uint32_t, 3>> faces_;
  GlHandle vertex_array_, vertices_buffer_, program_;
  // Of the picture that is being made; kept for their memory.
  std::vector<Vector3> view_mm_, normals_;
  std::vector<Vertex> vertices_;
  std::vector<std::uint8_t> rgba_, marks_;
  // By the picture's size.
  int width_ = 0, height_ = 0;
  GlHandle colour_, mark_, depth_, target_;
};

void SurfaceRenderer::Drawing::add_body(std::span<const double> displacement_m, const SurfaceScene& scene) {
  view_mm_.resize(rest_m_.size());
  for (std::size_t node = 0; node < rest_m_.size(); ++node) {
    Vector3 at_m = rest_m_[node];
    if (!displacement_m.empty()) at_m += Eigen::Map<const Vector3>(displacement_m.data() + 3 * node);
    view_mm_[node] = kMmPerM * scene.camera.view_m(at_m);
  }
  normals_.assign(rest_m_.size(), Vector3::Zero());
  for (const auto& [a, b, c] : faces_) {
    // As long as twice the face's area: large faces count more.
    const Vector3 normal = (view_mm_[b] - view_mm_[a]).cross(view_mm_[c] - view_mm_[a]);
    for (const std::uint32_t node : {a, b, c}) normals_[node] += normal;
  }
  const Float4 tissue = share_of(scene.tissue);
  for (const auto& face : faces_) {
    for (const std::uint32_t node : face) {
      vertices_.push_back({single(view_mm_[node], 0), single(normals_[node].normalized(), 0),
                           scene.node_colours.empty() ? tissue : share_of(scene.node_colours[node])});
    }
  }
}

void SurfaceRenderer::Drawing::add_solids(const SurfaceScene& scene) {
  for (const MarkedSolid& marked : scene.solids) {
    for (const SolidVertex& vertex : triangles_of(marked.solid)) {
      vertices_.push_back({single(kMmPerM * scene.camera.view_m(vertex.position_m), marked.mark),
                           single(scene.camera.to_view * vertex.normal, marked.ghost ? 1 : 0),
                           share_of(marked.solid.colour)});
    }
  }
}

void SurfaceRenderer::Drawing::resize(int width, int height) {
  if (width == width_ && height == height_) return;
  width_ = height_ = 0;  // until all is there, there is nothing of any size
  const auto texture = [&](GLenum format) {
    GlHandle made = make_texture(gl_, GL_TEXTURE_2D);
    gl_.TextureStorage2D(made.name(), 1, format, width, height);
    return made;
  };
  colour_ = texture(GL_RGBA8);
  mark_ = texture(GL_R8UI);
  depth_ = texture(GL_DEPTH_COMPONENT32F);
  target_ = make_framebuffer(gl_);
  constexpr std::array<GLenum, 2> kBoth{GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
  gl_.NamedFramebufferTexture(target_.name(), kBoth[0], colour_.name(), 0);
  gl_.NamedFramebufferTexture(target_.name(), kBoth[1], mark_.name(), 0);
  gl_.NamedFramebufferTexture(target_.name(), GL_DEPTH_ATTACHMENT, depth_.name(), 0);
  gl_.NamedFramebufferDrawBuffers(target_.name(), 2, kBoth.data());
  if (gl_.CheckNamedFramebufferStatus(target_.name(), GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    throw Error(context_->renderer() + " cannot draw a picture of such a size; make it smaller");
  width_ = width;
  height_ = height;
}

void SurfaceRenderer::Drawing::set_uniforms(const SurfaceScene& scene) {
  double nearest_mm = std::numeric_limits<double>::infinity(), farthest_mm = -nearest_mm;
  for (const Vertex& vertex : vertices_) {
    nearest_mm = std::min(nearest_mm, -double{vertex.position[2]});
    farthest_mm = std::max(farthest_mm, -double{vertex.position[2]});
  }
  // A little more than what is there, all of it in front of the eye.
  const double least_mm = scene.camera.parallel ? nearest_mm - 1 : 1;
  nearest_mm = std::max(nearest_mm - 1, least_mm);
  farthest_mm = std::max(farthest_mm, nearest_mm) + 1;
  const double scale = scene.camera.parallel ? kMmPerM : 1;
  const auto set4 = [&](const char* name, const Float4& value) {
    gl_.ProgramUniform4f(program_.name(), gl_.GetUniformLocation(program_.name(), name), value[0], value[1],
                         value[2], value[3]);
  };
  set4("view", single(scale * Vector3(scene.camera.half_extent.x(), scene.camera.half_extent.y(),
                                      scene.camera.centre.x()),
                      scale * scene.camera.centre.y()));
  set4("depth", single({nearest_mm, farthest_mm, 0}, 0));
  gl_.ProgramUniform1f(program_.name(), gl_.GetUniformLocation(program_.name(), "parallel"),
                       scene.camera.parallel ? 1.0F : 0.0F);
  const Eigen::Vector3f light = scene.to_light.normalized().cast<float>();
  gl_.ProgramUniform3f(program_.name(), gl_.GetUniformLocation(program_.name(), "light"), light.x(),
                       light.y(), light.z());
}

SurfacePicture SurfaceRenderer::Drawing::draw(std::span<const double> displacement_m,
                                              const SurfaceScene& scene) {
  context_->make_current();
  resize(scene.width, scene.height);
  vertices_.clear();
  if (scene.shows_body) add_body(displacement_m, scene);
  add_solids(scene);
  const Float4 background = share_of(scene.background);
  const std::array<GLuint, 4> unmarked{};
  constexpr float kFarthest = 1;
  gl_.ClearNamedFramebufferfv(target_.name(), GL_COLOR, 0, background.data());
  gl_.ClearNamedFramebufferuiv(target_.name(), GL_COLOR, 1, unmarked.data());
  gl_.ClearNamedFramebufferfv(target_.name(), GL_DEPTH, 0, &kFarthest);
  if (!vertices_.empty()) {
    fill_buffer<Vertex>(gl_, vertices_buffer_, vertices_);
    set_uniforms(scene);
    gl_.BindVertexArray(vertex_array_.name());
    gl_.Viewport(0, 0, scene.width, scene.height);
    gl_.BindFramebuffer(GL_FRAMEBUFFER, target_.name());
    gl_.UseProgram(program_.name());
    gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, vertices_buffer_.name());
    gl_.Enable(GL_DEPTH_TEST);
    gl_.DepthFunc(GL_LESS);
    gl_.Enable(GL_CULL_FACE);
    gl_.CullFace(GL_BACK);
    gl_.DrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(vertices_.size()));
  }
  return read(scene.width, scene.height);
}

SurfacePicture SurfaceRenderer::Drawing::read(int width, int height) {
  const std::size_t row = static_cast<std::size_t>(width), pixels = row * static_cast<std::size_t>(height);
  rgba_.resize(4 * pixels);
  marks_.resize(pixels);
  gl_.BindFramebuffer(GL_FRAMEBUFFER, target_.name());
  gl_.PixelStorei(GL_PACK_ALIGNMENT, 1);
  gl_.NamedFramebufferReadBuffer(target_.name(), GL_COLOR_ATTACHMENT0);
  gl_.ReadPixels(0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, rgba_.data());
  gl_.NamedFramebufferReadBuffer(target_.name(), GL_COLOR_ATTACHMENT1);
  gl_.ReadPixels(0, 0, width, height, GL_RED_INTEGER, GL_UNSIGNED_BYTE, marks_.data());
  check_gl(gl_, "draw a picture with " + context_->renderer());
  SurfacePicture found;
  found.picture = Picture(width, height);
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* from = rgba_.data() + 4 * row * static_cast<std::size_t>(height - 1 - y);
    std::uint8_t* to = found.picture.pixel(0, y);
    for (int x = 0; x < width; ++x, from += 4, to += 3) std::copy_n(from, 3, to);
  }
  for (const std::uint8_t mark : marks_) ++found.pixels_of_mark[mark];
  return found;
}

SurfaceRenderer::SurfaceRenderer(const TetMesh& mesh, GpuUse use, const GpuMaker& make_gpu) {
  ChosenContext chosen = choose_context(use, make_gpu);
  notice_ = chosen.notice;
  drawing_ = std::make_unique<Drawing>(std::move(chosen.context), mesh);
}

SurfaceRenderer::~SurfaceRenderer() = default;

const std::string& SurfaceRenderer::renderer() const { return drawing_->context().renderer(); }

SurfacePicture SurfaceRenderer::render(std::span<const double> displacement_m, const SurfaceScene& scene) {
  if (scene.width < 1 || scene.height < 1 || scene.width > kLargestSide || scene.height > kLargestSide) {
    throw UsageError("a picture of " + std::to_string(scene.width) + "x" + std::to_string(scene.height) +
                     " pixels cannot be drawn: sides must be from 1 to 8192");
  }
  const std::size_t nodes = drawing_->nodes();
  if ((!displacement_m.empty() && displacement_m.size() != 3 * nodes) ||
      (!scene.node_colours.empty() && scene.node_colours.size() != nodes)) {
    throw UsageError("a surface of a mesh of " + std::to_string(nodes) +
                     " nodes needs a displacement and a colour for each of them");
  }
  if (!std::ranges::all_of(displacement_m, [](double u) { return std::isfinite(u); }))
    throw UsageError("a displacement is no finite number, so nothing can be drawn");
  return drawing_->draw(displacement_m, scene);
}

}  // namespace kiroku::sim

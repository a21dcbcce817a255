#include "sim/render/volume_renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <thread>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "sim/mesh/length_unit.h"
#include "sim/render/colour_map.h"
#include "sim/render/gl_objects.h"
#include "sim/render/gl_vector.h"
#include "sim/render/picture_squares.h"
#include "sim/render/preintegration.h"
#include "sim/render/shaders.h"
#include "sim/render/tip_lighting.h"

namespace kiroku::sim {
namespace {

constexpr int kLargestPictureSide = 8192;
constexpr float kFar = 1e30F;

Float4 share_of(const Rgb& colour, double fourth) {
  return single(Vector3(colour[0], colour[1], colour[2]) / 255, fourth);
}

}  // namespace

/// What is OpenGL's: one context and all objects in it.
class VolumeRenderer::Drawing {
 public:
  Drawing(std::unique_ptr<GlContext> context, const ShadedVolume& volume, const TransferFunction& transfer);

  ~Drawing();
  Drawing(const Drawing&) = delete;
  Drawing& operator=(const Drawing&) = delete;

  void set_mesh(const PlacedMesh& mesh);
  /// The mesh's nodes are placed; its cells are placed while a graphics processor peels.
  Picture draw(PlacedMesh& mesh, const Scene& scene, double spacing_m);
  [[nodiscard]] const GlContext& context() const { return *context_; }

 private:
  void upload(const ShadedVolume& volume);
  void upload_colours(std::vector<Float4> colours, const GlHandle& plain, const GlHandle& linear);
  const GlHandle& segments_of(double length_mm, bool linear);
  void resize(int width, int height);
  void make_room_to_pack(int width, int height);
  void attach(const GlHandle& framebuffer, std::span<const GLenum> attachments);
  void set(const GlHandle& program, const char* name, const Float4& value);
  void set(const GlHandle& program, const char* name, double value);
  void set(const GlHandle& program, const char* name, int value);
  void set_camera(const GlHandle& program, const Scene& scene);
  void draw_solids(const Scene& scene);
  void give_cells(PlacedMesh& mesh, const Scene& scene);
  void set_tip(const GlHandle& program, const TipLight& tip);
  int find_by_lens(const PlacedMesh& mesh, const Scene& scene);
  int peel(const PlacedMesh& mesh, const Scene& scene, int first, int last, bool until_empty);
  [[nodiscard]] bool has_faces(int layer) const;
  void cast(const PlacedMesh& mesh, const Scene& scene, int layers, double spacing_m);
  Picture read(int width, int height);
  Picture read_packed(int width, int height);
  const GlHandle& ray_program(const RayFeatures& features);

  std::unique_ptr<GlContext> context_;
  const GlFunctions& gl_;
  TransferFunction transfer_;
  GlHandle vertex_array_, volume_, stress_colours_;
  GlHandle linear_stress_;  // the same, linear in light
  GlHandle nodes_of_hu_;    // as preintegration.h has them
  /// By the segments' length, and whether their colours are linear in light.
  std::map<std::pair<double, bool>, GlHandle> segments_;
  GlHandle positions_, surface_, cells_, links_, rotations_, stress_, solid_vertices_;
  GlHandle entry_program_, solid_program_;
  GlHandle tip_solid_program_;  // once it is asked for
  GlHandle pack_program_;       // on a graphics processor
  std::array<GlHandle, kMostLayers> queries_;
  std::map<RayFeatures, GlHandle> ray_programs_;
  // By the picture's size.
  int width_ = 0, height_ = 0;
  GlHandle packed_;
  const std::uint8_t* mapped_ = nullptr;  // packed_'s memory; none where pictures are not packed
  GlHandle entries_, solid_colour_, solid_distance_, solid_depth_, picture_;
  GlHandle slopes_;                           // where a lens bends the rays
  std::shared_ptr<const LensRays> uploaded_;  // whose they are
  std::array<GlHandle, 2> depths_;
  std::array<GlHandle, kMostLayers> entry_targets_;  // a layer each, over the two depths in turn
  GlHandle solid_target_, picture_target_;
  std::vector<std::uint8_t> rgba_;
  double nearest_mm_ = 1, farthest_mm_ = 2;
  int expected_layers_ = 1;  // as many as the last picture had
};

VolumeRenderer::Drawing::Drawing(std::unique_ptr<GlContext> context, const ShadedVolume& volume,
                                 const TransferFunction& transfer)
    : context_(std::move(context)),
      gl_(context_->gl()),
      transfer_(transfer),
      vertex_array_(make_vertex_array(gl_)),
      volume_(make_texture(gl_, GL_TEXTURE_3D)),
      stress_colours_(make_texture(gl_, GL_TEXTURE_1D)),
      linear_stress_(make_texture(gl_, GL_TEXTURE_1D)),
      nodes_of_hu_(make_texture(gl_, GL_TEXTURE_1D)),
      positions_(make_buffer(gl_)),
      surface_(make_buffer(gl_)),
      cells_(make_buffer(gl_)),
      links_(make_buffer(gl_)),
      rotations_(make_buffer(gl_)),
      stress_(make_buffer(gl_)),
      solid_vertices_(make_buffer(gl_)),
      entry_program_(make_program(gl_, entry_vertex_shader(), entry_fragment_shader())),
      solid_program_(make_program(gl_, solid_vertex_shader(), solid_fragment_shader(false))) {
  for (GlHandle& query : queries_) query = make_query(gl_, GL_ANY_SAMPLES_PASSED);
  if (!context_->is_software()) pack_program_ = make_compute_program(gl_, pack_compute_shader());
  upload(volume);
}

VolumeRenderer::Drawing::~Drawing() {
  try {
    context_->make_current();  // to free what is in it
  } catch (const Error&) {     // the driver is gone, and all it had with it
  }
}

void VolumeRenderer::Drawing::upload(const ShadedVolume& volume) {
  GLint largest = 0;
  gl_.GetIntegerv(GL_MAX_3D_TEXTURE_SIZE, &largest);
  if (*std::ranges::max_element(volume.size) > static_cast<std::size_t>(largest)) {
    throw Error("the CT has more voxels along a side than " + context_->renderer() + " can hold (" +
                std::to_string(largest) + "): show a smaller part of it with --mesh");
  }
  const auto side = [&](std::size_t axis) { return static_cast<GLsizei>(volume.size[axis]); };
  gl_.TextureStorage3D(volume_.name(), 1, GL_RGBA16, side(0), side(1), side(2));
  gl_.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
  gl_.TextureSubImage3D(volume_.name(), 0, 0, 0, 0, side(0), side(1), side(2), GL_RGBA, GL_UNSIGNED_SHORT,
                        volume.texels.data());
  gl_.TextureParameteri(volume_.name(), GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  gl_.TextureParameteri(volume_.name(), GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  // The texels at the border are air.
  for (const GLenum axis : {GLenum{GL_TEXTURE_WRAP_S}, GLenum{GL_TEXTURE_WRAP_T}, GLenum{GL_TEXTURE_WRAP_R}})
    gl_.TextureParameteri(volume_.name(), axis, GL_CLAMP_TO_EDGE);
  gl_.TextureStorage1D(nodes_of_hu_.name(), 1, GL_R8UI, static_cast<GLsizei>(kHuEntries));
  sample_nearest(gl_, nodes_of_hu_);
  std::vector<Float4> colours;
  constexpr int kStressColours = 256;
  for (int i = 0; i < kStressColours; ++i)
    colours.push_back(share_of(viridis(i / double{kStressColours - 1}), 1));
  upload_colours(colours, stress_colours_, linear_stress_);
  check_gl(gl_, "give the CT to " + context_->renderer());
}

void VolumeRenderer::Drawing::upload_colours(std::vector<Float4> colours, const GlHandle& plain,
                                             const GlHandle& linear) {
  for (const GlHandle* const texture : {&plain, &linear}) {
    const auto count = static_cast<GLsizei>(colours.size());
    gl_.TextureStorage1D(texture->name(), 1, GL_RGBA32F, count);
    gl_.TextureSubImage1D(texture->name(), 0, 0, count, GL_RGBA, GL_FLOAT, colours.data());
    sample_nearest(gl_, *texture);
    for (Float4& colour : colours) {
      for (std::size_t c = 0; c < 3; ++c) colour[c] = static_cast<float>(linear_light(double{colour[c]}));
    }
  }
}

/// The table for segments of such a length, computed where it is not there.
const GlHandle& VolumeRenderer::Drawing::segments_of(double length_mm, bool linear) {
  const std::pair key(length_mm, linear);
  if (const auto found = segments_.find(key); found != segments_.end()) return found->second;
  constexpr std::size_t kMost = 8;
  if (segments_.size() == kMost) segments_.clear();
  const Preintegration table = preintegrate(transfer_, length_mm, linear);
  constexpr auto kSide = static_cast<GLsizei>(Preintegration::kNodes);
  GlHandle texture = make_texture(gl_, GL_TEXTURE_2D);
  gl_.TextureStorage2D(texture.name(), 1, GL_RGBA16F, kSide, kSide);
  sample_nearest(gl_, texture);
  gl_.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
  gl_.TextureSubImage2D(texture.name(), 0, 0, 0, kSide, kSide, GL_RGBA, GL_HALF_FLOAT, table.segments.data());
  // The same for each length.
  gl_.TextureSubImage1D(nodes_of_hu_.name(), 0, 0, static_cast<GLsizei>(kHuEntries), GL_RED_INTEGER,
                        GL_UNSIGNED_BYTE, table.node_of.data());
  return segments_.emplace(key, std::move(texture)).first->second;
}

void VolumeRenderer::Drawing::set_mesh(const PlacedMesh& mesh) {
  context_->make_current();
  fill_buffer<EntryFace>(gl_, surface_, mesh.topology.surface);
  fill_buffer<CellLinks>(gl_, links_, mesh.topology.cells);
  fill_buffer<float>(gl_, stress_, {});
  check_gl(gl_, "give the mesh to " + context_->renderer());
}

void VolumeRenderer::Drawing::attach(const GlHandle& framebuffer, std::span<const GLenum> attachments) {
  gl_.NamedFramebufferDrawBuffers(framebuffer.name(), static_cast<GLsizei>(attachments.size()),
                                  attachments.data());
  if (gl_.CheckNamedFramebufferStatus(framebuffer.name(), GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    throw Error(context_->renderer() + " cannot draw a picture of such a size; make it smaller");
  }
}

void VolumeRenderer::Drawing::resize(int width, int height) {
  if (width == width_ && height == height_) return;
  // Until all is there, there is nothing of any size.
  width_ = height_ = 0;
  const auto texture = [&](GLenum format) {
    GlHandle made = make_texture(gl_, GL_TEXTURE_2D);
    gl_.TextureStorage2D(made.name(), 1, format, width, height);
    sample_nearest(gl_, made);
    return made;
  };
  entries_ = make_texture(gl_, GL_TEXTURE_2D_ARRAY);
  gl_.TextureStorage3D(entries_.name(), 1, GL_R32UI, width, height, kMostLayers);
  sample_nearest(gl_, entries_);
  for (GlHandle& depth : depths_) depth = texture(GL_DEPTH_COMPONENT32F);
  solid_colour_ = texture(GL_RGBA8);
  solid_distance_ = texture(GL_R32F);
  solid_depth_ = texture(GL_DEPTH_COMPONENT32F);
  picture_ = texture(GL_RGBA8);
  uploaded_.reset();
  solid_target_ = make_framebuffer(gl_);
  picture_target_ = make_framebuffer(gl_);
  constexpr std::array<GLenum, 2> kBoth{GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
  const std::span<const GLenum> one = std::span(kBoth).first(1);
  for (std::size_t layer = 0; layer < entry_targets_.size(); ++layer) {
    GlHandle& target = entry_targets_[layer] = make_framebuffer(gl_);
    gl_.NamedFramebufferTextureLayer(target.name(), GL_COLOR_ATTACHMENT0, entries_.name(), 0,
                                     static_cast<GLint>(layer));
    gl_.NamedFramebufferTexture(target.name(), GL_DEPTH_ATTACHMENT, depths_[layer % 2].name(), 0);
    attach(target, one);
  }
  gl_.NamedFramebufferTexture(solid_target_.name(), GL_COLOR_ATTACHMENT0, solid_colour_.name(), 0);
  gl_.NamedFramebufferTexture(solid_target_.name(), GL_COLOR_ATTACHMENT1, solid_distance_.name(), 0);
  gl_.NamedFramebufferTexture(solid_target_.name(), GL_DEPTH_ATTACHMENT, solid_depth_.name(), 0);
  attach(solid_target_, kBoth);
  gl_.NamedFramebufferTexture(picture_target_.name(), GL_COLOR_ATTACHMENT0, picture_.name(), 0);
  attach(picture_target_, one);
  make_room_to_pack(width, height);
  check_gl(gl_,
           "make room for a picture of " + std::to_string(width) + "x" + std::to_string(height) + " pixels");
  width_ = width;
  height_ = height;
}

void VolumeRenderer::Drawing::make_room_to_pack(int width, int height) {
  packed_ = {};
  mapped_ = nullptr;
  if (context_->is_software()) return;
  const GLsizeiptr bytes = (GLsizeiptr{3} * width * height + 3) / 4 * 4;
  GLint64 most = 0;
  gl_.GetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &most);
  if (bytes > most) return;
  constexpr GLbitfield kRead = GL_MAP_READ_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
  packed_ = make_buffer(gl_);
  gl_.NamedBufferStorage(packed_.name(), bytes, nullptr, kRead);
  mapped_ = static_cast<const std::uint8_t*>(gl_.MapNamedBufferRange(packed_.name(), 0, bytes, kRead));
}

void VolumeRenderer::Drawing::set(const GlHandle& program, const char* name, const Float4& value) {
  gl_.ProgramUniform4f(program.name(), gl_.GetUniformLocation(program.name(), name), value[0], value[1],
                       value[2], value[3]);
}
void VolumeRenderer::Drawing::set(const GlHandle& program, const char* name, double value) {
  gl_.ProgramUniform1f(program.name(), gl_.GetUniformLocation(program.name(), name),
                       static_cast<float>(value));
}
void VolumeRenderer::Drawing::set(const GlHandle& program, const char* name, int value) {
  gl_.ProgramUniform1i(program.name(), gl_.GetUniformLocation(program.name(), name), value);
}

void VolumeRenderer::Drawing::set_camera(const GlHandle& program, const Scene& scene) {
  const Camera& camera = scene.camera;
  const double scale = camera.parallel ? kMmPerM : 1;
  set(program, "view",
      single(Vector3(camera.half_extent.x(), camera.half_extent.y(), camera.centre.x()) * scale,
             camera.centre.y() * scale));
  set(program, "parallel", camera.parallel ? 1.0 : 0.0);
  set(program, "depth", single(Vector3(nearest_mm_, farthest_mm_, 0)));
}

void VolumeRenderer::Drawing::draw_solids(const Scene& scene) {
  struct Vertex {
    Float4 position, normal, colour;
  };
  std::vector<Vertex> vertices;
  for (const Solid& solid : scene.solids) {
    for (const SolidVertex& vertex : triangles_of(solid)) {
      const Vector3 position_mm = kMmPerM * scene.camera.view_m(vertex.position_m);
      vertices.push_back(
          {single(position_mm, 1), single(scene.camera.to_view * vertex.normal), share_of(solid.colour, 1)});
      nearest_mm_ = std::min(nearest_mm_, -position_mm.z());
      farthest_mm_ = std::max(farthest_mm_, -position_mm.z());
    }
  }
  // A little more than what is there, all of it in front of the eye.
  const double least_mm = scene.camera.parallel ? nearest_mm_ - 1 : 1;
  nearest_mm_ = std::max(nearest_mm_ - 1, least_mm);
  farthest_mm_ = std::max(farthest_mm_, nearest_mm_) + 1;
  const Float4 background = share_of(scene.background, 1);
  const Float4 far{kFar, 0, 0, 0};
  constexpr float kFarthest = 1;
  gl_.ClearNamedFramebufferfv(solid_target_.name(), GL_COLOR, 0, background.data());
  gl_.ClearNamedFramebufferfv(solid_target_.name(), GL_COLOR, 1, far.data());
  gl_.ClearNamedFramebufferfv(solid_target_.name(), GL_DEPTH, 0, &kFarthest);
  if (vertices.empty()) return;
  fill_buffer<Vertex>(gl_, solid_vertices_, vertices);
  if (scene.tip_light && tip_solid_program_.name() == 0)
    tip_solid_program_ = make_program(gl_, solid_vertex_shader(), solid_fragment_shader(true));
  const GlHandle& program = scene.tip_light ? tip_solid_program_ : solid_program_;
  set_camera(program, scene);
  const Vector3 light = scene.to_light.normalized();
  gl_.ProgramUniform3f(program.name(), gl_.GetUniformLocation(program.name(), "light"),
                       static_cast<float>(light.x()), static_cast<float>(light.y()),
                       static_cast<float>(light.z()));
  if (scene.tip_light) set_tip(program, *scene.tip_light);
  gl_.BindFramebuffer(GL_FRAMEBUFFER, solid_target_.name());
  gl_.UseProgram(program.name());
  gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, solid_vertices_.name());
  gl_.Enable(GL_DEPTH_TEST);
  gl_.Enable(GL_CULL_FACE);
  gl_.DrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(vertices.size()));
}

void VolumeRenderer::Drawing::set_tip(const GlHandle& program, const TipLight& tip) {
  set(program, "tip", single(tip.at_m * kMmPerM, std::pow(tip.working_distance_m * kMmPerM, 2)));
  set(program, "film", single(Vector3(tip.wet, std::pow(tip.roughness, 4), kWaterReflectance)));
}

/// What the pixels meet where a lens bends their rays, which no rasteriser can follow: found by the
/// processor, as the ray caster has it. How many layers there are.
int VolumeRenderer::Drawing::find_by_lens(const PlacedMesh& mesh, const Scene& scene) {
  const auto width = static_cast<std::size_t>(width_), height = static_cast<std::size_t>(height_);
  const PictureSquares squares(mesh, scene);
  std::vector<std::uint32_t> entries(width * height * kMostLayers, kNoCell);
  std::vector<float> distance_mm(width * height), colours(3 * width * height), slopes(2 * width * height);
  std::vector<int> layers(squares.count());
  for_each_part(squares.count(), std::max(std::thread::hardware_concurrency(), 1U), [&](std::size_t number) {
    const std::unique_ptr<PictureSquare> square = squares.square(number);
    for (int y = square->y0; y < square->y1; ++y) {
      for (int x = square->x0; x < square->x1; ++x) {
        const auto from = static_cast<std::size_t>((y - square->y0) * kMarchTile + x - square->x0);
        // OpenGL's rows come from below.
        const std::size_t to =
            (height - 1 - static_cast<std::size_t>(y)) * width + static_cast<std::size_t>(x);
        const int met = square->layers[from];
        layers[number] = std::max(layers[number], met);
        for (int layer = 0; layer < met; ++layer) {
          const auto at = static_cast<std::size_t>(layer);
          entries[at * width * height + to] = square->entries[from * kMarchLayers + at];
        }
        distance_mm[to] = square->end_mm[from];
        for (std::size_t c = 0; c < 3; ++c) colours[3 * to + c] = square->colour[3 * from + c];
        for (std::size_t c = 0; c < 2; ++c) slopes[2 * to + c] = square->slopes[2 * from + c];
      }
    }
  });
  const int most = *std::ranges::max_element(layers);
  gl_.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
  gl_.TextureSubImage3D(entries_.name(), 0, 0, 0, 0, width_, height_, std::max(most, 1), GL_RED_INTEGER,
                        GL_UNSIGNED_INT, entries.data());
  gl_.TextureSubImage2D(solid_colour_.name(), 0, 0, 0, width_, height_, GL_RGB, GL_FLOAT, colours.data());
  gl_.TextureSubImage2D(solid_distance_.name(), 0, 0, 0, width_, height_, GL_RED, GL_FLOAT,
                        distance_mm.data());
  if (uploaded_ != scene.lens) {
    slopes_ = make_texture(gl_, GL_TEXTURE_2D);
    gl_.TextureStorage2D(slopes_.name(), 1, GL_RG32F, width_, height_);
    sample_nearest(gl_, slopes_);
    gl_.TextureSubImage2D(slopes_.name(), 0, 0, 0, width_, height_, GL_RG, GL_FLOAT, slopes.data());
    uploaded_ = scene.lens;
  }
  return most;
}

/// Draws the layers from `first` on, until all before `last` are there or, where that is asked for, one is
/// empty. How many there are then.
int VolumeRenderer::Drawing::peel(const PlacedMesh& mesh, const Scene& scene, int first, int last,
                                  bool until_empty) {
  set_camera(entry_program_, scene);
  gl_.UseProgram(entry_program_.name());
  gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, positions_.name());
  gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 1, surface_.name());
  gl_.Enable(GL_DEPTH_TEST);
  gl_.DepthFunc(GL_LESS);
  gl_.Enable(GL_CULL_FACE);
  gl_.CullFace(GL_BACK);
  for (int layer = first; layer < last; ++layer) {
    const GLuint target = entry_targets_[static_cast<std::size_t>(layer)].name();
    gl_.BindFramebuffer(GL_FRAMEBUFFER, target);
    const std::array<GLuint, 4> none{kNoCell, 0, 0, 0};
    constexpr float kFarthest = 1;
    gl_.ClearNamedFramebufferuiv(target, GL_COLOR, 0, none.data());
    gl_.ClearNamedFramebufferfv(target, GL_DEPTH, 0, &kFarthest);
    gl_.BindTextureUnit(0, depths_[static_cast<std::size_t>(layer + 1) % 2].name());
    set(entry_program_, "layer", layer);
    gl_.BeginQuery(GL_ANY_SAMPLES_PASSED, queries_[static_cast<std::size_t>(layer)].name());
    gl_.DrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(3 * mesh.topology.surface.size()));
    gl_.EndQuery(GL_ANY_SAMPLES_PASSED);
    if (until_empty && !has_faces(layer)) return layer;
  }
  return last;
}

/// Waits for the answer.
bool VolumeRenderer::Drawing::has_faces(int layer) const {
  GLuint any = 0;
  gl_.GetQueryObjectuiv(queries_[static_cast<std::size_t>(layer)].name(), GL_QUERY_RESULT, &any);
  return any != 0;
}

const GlHandle& VolumeRenderer::Drawing::ray_program(const RayFeatures& features) {
  const auto found = ray_programs_.find(features);
  if (found != ray_programs_.end()) return found->second;
  GlHandle program = context_->is_software()
                         ? make_program(gl_, whole_picture_vertex_shader(), ray_fragment_shader(features))
                         : make_compute_program(gl_, ray_compute_shader(features));
  return ray_programs_.emplace(features, std::move(program)).first->second;
}

void VolumeRenderer::Drawing::cast(const PlacedMesh& mesh, const Scene& scene, int layers, double spacing_m) {
  const GlHandle& program = ray_program({scene.surface.has_value(), scene.stress.has_value(),
                                         scene.tip_light.has_value(), scene.lens != nullptr});
  set_camera(program, scene);
  set(program, "layers", layers);
  set(program, "picture",
      {static_cast<float>(scene.width), static_cast<float>(scene.height), 1 / static_cast<float>(scene.width),
       1 / static_cast<float>(scene.height)});
  set(program, "spacing", spacing_m * kMmPerM);
  set(program, "lighting",
      single(Vector3(transfer_.ambient, transfer_.diffuse, transfer_.specular), transfer_.shininess));
  const auto [flat, steep] = transfer_.edge_hu_per_mm;
  constexpr double kStep = kGreatestGradientHuPerMm / 32767;
  set(program, "edge", single(Vector3(flat, 1 / (steep - flat), 65535 * kStep), 32768 * kStep));
  const Vector3 light = scene.to_light.normalized();
  gl_.ProgramUniform3f(program.name(), gl_.GetUniformLocation(program.name(), "light"),
                       static_cast<float>(light.x()), static_cast<float>(light.y()),
                       static_cast<float>(light.z()));
  if (scene.tip_light) set_tip(program, *scene.tip_light);
  if (scene.surface) {
    set(program, "sheet",
        scene.tip_light ? single(linear_light(scene.surface->colour), scene.surface->opacity)
                        : share_of(scene.surface->colour, scene.surface->opacity));
  }
  if (scene.stress) {
    std::vector<float> stress(scene.stress->at_nodes_pa.size());
    std::ranges::transform(scene.stress->at_nodes_pa, stress.begin(),
                           [](double pa) { return static_cast<float>(pa); });
    fill_buffer<float>(gl_, stress_, stress);
    set(program, "tint", single(Vector3(scene.stress->share, 1 / scene.stress->largest_pa, 0)));
  }
  gl_.UseProgram(program.name());
  gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, cells_.name());
  gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 1, links_.name());
  gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 2, rotations_.name());
  gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 3, stress_.name());
  gl_.BindTextureUnit(0, entries_.name());
  gl_.BindTextureUnit(1, solid_colour_.name());
  gl_.BindTextureUnit(2, solid_distance_.name());
  gl_.BindTextureUnit(3, volume_.name());
  gl_.BindTextureUnit(4, segments_of(spacing_m * kMmPerM, scene.tip_light.has_value()).name());
  gl_.BindTextureUnit(5, (scene.tip_light ? linear_stress_ : stress_colours_).name());
  if (scene.lens) gl_.BindTextureUnit(6, slopes_.name());
  gl_.BindTextureUnit(7, nodes_of_hu_.name());
  // Rays are followed where the mesh is; beside it there is what is behind.
  gl_.BlitNamedFramebuffer(solid_target_.name(), picture_target_.name(), 0, 0, width_, height_, 0, 0, width_,
                           height_, GL_COLOR_BUFFER_BIT, GL_NEAREST);
  const auto [least, greatest] = mesh.covered(scene);
  const Eigen::Vector2i pixels = greatest - least;
  if (!context_->is_software()) {
    // Graphics processors for computing have few units that draw; all of them compute.
    gl_.ProgramUniform4i(program.name(), gl_.GetUniformLocation(program.name(), "covered"), least.x(),
                         least.y(), greatest.x(), greatest.y());
    gl_.BindImageTexture(0, picture_.name(), 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_RGBA8);
    const auto groups = [](int count) { return static_cast<GLuint>((count + kRayGroup - 1) / kRayGroup); };
    gl_.DispatchCompute(groups(pixels.x()), groups(pixels.y()), 1);
    gl_.MemoryBarrier(GL_FRAMEBUFFER_BARRIER_BIT | GL_TEXTURE_FETCH_BARRIER_BIT);
    return;
  }
  gl_.BindFramebuffer(GL_FRAMEBUFFER, picture_target_.name());
  gl_.Disable(GL_DEPTH_TEST);
  gl_.Disable(GL_CULL_FACE);
  gl_.Enable(GL_SCISSOR_TEST);
  gl_.Scissor(least.x(), least.y(), pixels.x(), pixels.y());
  gl_.DrawArrays(GL_TRIANGLES, 0, 3);
  gl_.Disable(GL_SCISSOR_TEST);
}

/// The graphics processor packs the picture as it is wanted and writes it into memory of this side.
Picture VolumeRenderer::Drawing::read_packed(int width, int height) {
  const std::size_t bytes =
      std::size_t{3} * static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  constexpr std::size_t kGroupsInARow = 1024;
  const std::size_t groups = (bytes + 4 * kPackGroup - 1) / (4 * kPackGroup);
  gl_.UseProgram(pack_program_.name());
  gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, packed_.name());
  gl_.BindTextureUnit(0, picture_.name());
  gl_.DispatchCompute(static_cast<GLuint>(std::min(groups, kGroupsInARow)),
                      static_cast<GLuint>((groups + kGroupsInARow - 1) / kGroupsInARow), 1);
  gl_.MemoryBarrier(GL_CLIENT_MAPPED_BUFFER_BARRIER_BIT);
  const GLsync drawn = gl_.FenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
  const GLenum answer =
      gl_.ClientWaitSync(drawn, GL_SYNC_FLUSH_COMMANDS_BIT, std::numeric_limits<GLuint64>::max());
  gl_.DeleteSync(drawn);
  check_gl(gl_, "draw a picture with " + context_->renderer());
  if (answer != GL_ALREADY_SIGNALED && answer != GL_CONDITION_SATISFIED)
    throw Error("cannot draw a picture with " + context_->renderer() + ": OpenGL did not finish it");
  Picture picture;
  picture.width = width;
  picture.height = height;
  picture.rgb.assign(mapped_, mapped_ + bytes);
  return picture;
}

Picture VolumeRenderer::Drawing::read(int width, int height) {
  if (mapped_ != nullptr) return read_packed(width, height);
  rgba_.resize(4 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  gl_.BindFramebuffer(GL_FRAMEBUFFER, picture_target_.name());
  gl_.NamedFramebufferReadBuffer(picture_target_.name(), GL_COLOR_ATTACHMENT0);
  gl_.PixelStorei(GL_PACK_ALIGNMENT, 1);
  gl_.ReadPixels(0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, rgba_.data());
  check_gl(gl_, "draw a picture with " + context_->renderer());
  Picture picture(width, height);
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* from =
        rgba_.data() + 4 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height - 1 - y);
    std::uint8_t* to = picture.pixel(0, y);
    // Four bytes at once, of which the next pixel overwrites the last.
    for (int x = 0; x + 1 < width; ++x, from += 4, to += 3) std::copy_n(from, 4, to);
    std::copy_n(from, 3, to);
  }
  return picture;
}

void VolumeRenderer::Drawing::give_cells(PlacedMesh& mesh, const Scene& scene) {
  mesh.place_cells(scene.camera);
  fill_buffer<CellGeometry>(gl_, cells_, mesh.cells);
  fill_buffer<Float4>(gl_, rotations_, mesh.rotations4);
}

Picture VolumeRenderer::Drawing::draw(PlacedMesh& mesh, const Scene& scene, double spacing_m) {
  context_->make_current();
  resize(scene.width, scene.height);
  gl_.BindVertexArray(vertex_array_.name());
  gl_.Viewport(0, 0, scene.width, scene.height);
  fill_buffer<Float4>(gl_, positions_, mesh.positions4);
  nearest_mm_ = mesh.nearest_mm;
  farthest_mm_ = mesh.farthest_mm;
  if (scene.lens) {
    const int layers = find_by_lens(mesh, scene);
    give_cells(mesh, scene);
    cast(mesh, scene, layers, spacing_m);
    return read(scene.width, scene.height);
  }
  draw_solids(scene);
  // In software each layer is waited for, as one too many costs more. A graphics processor is given as many
  // as the last picture had and one more, and is asked with the picture whether that one is empty.
  const bool waits = context_->is_software();
  int layers = peel(mesh, scene, 0, waits ? kMostLayers : std::min(expected_layers_ + 1, kMostLayers), waits);
  gl_.Flush();
  give_cells(mesh, scene);
  cast(mesh, scene, layers, spacing_m);
  Picture picture = read(scene.width, scene.height);
  if (waits) return picture;
  if (has_faces(layers - 1) && layers < kMostLayers) {
    layers = peel(mesh, scene, layers, kMostLayers, true);
    cast(mesh, scene, layers, spacing_m);
    picture = read(scene.width, scene.height);
  }
  while (layers > 0 && !has_faces(layers - 1)) --layers;
  expected_layers_ = layers;
  return picture;
}

VolumeRenderer::VolumeRenderer(std::shared_ptr<const ShadedVolume> volume, const TransferFunction& transfer,
                               const EngineChoice& choice, const GpuMaker& make_gpu)
    : volume_(std::move(volume)), transfer_(transfer), engine_(choice.engine) {
  std::unique_ptr<GlContext> gpu;
  if (choice.gpu == GpuUse::kAuto && engine_ != Engine::kProcessor) {
    try {
      gpu = make_gpu();
    } catch (const Error& error) {
      notice_ = std::string("the graphics processor is not used, pictures are computed in software: ") +
                error.what();
    }
  }
  const bool on_gpu = gpu != nullptr;
  try {
    start(std::move(gpu));
  } catch (const Error& error) {
    if (!on_gpu) throw;
    go_on_in_software(error.what());
  }
}

VolumeRenderer::~VolumeRenderer() = default;

void VolumeRenderer::start(std::unique_ptr<GlContext> context) {
  if (!context && engine_ != Engine::kOpenGl) {
    caster_ = std::make_unique<RayCaster>(volume_, transfer_);
  } else {
    if (!context) context = make_software_context();
    drawing_ = std::make_unique<Drawing>(std::move(context), *volume_, transfer_);
  }
}

bool VolumeRenderer::is_on_gpu() const { return drawing_ && !drawing_->context().is_software(); }

const std::string& VolumeRenderer::renderer() const {
  return caster_ ? caster_->name() : drawing_->context().renderer();
}

void VolumeRenderer::go_on_in_software(const std::string& why) {
  notice_ = "the graphics processor failed, pictures are computed in software from now on: " + why;
  drawing_.reset();
  start(nullptr);
  if (mesh_ && drawing_) drawing_->set_mesh(*mesh_);
  if (mesh_ && caster_) caster_->set_mesh(*mesh_);
}

void VolumeRenderer::set_mesh(const TetMesh& rest) {
  auto mesh = std::make_unique<PlacedMesh>(rest);
  mesh->texture.reserve(rest.nodes.size());
  for (const Vector3& node : rest.nodes) mesh->texture.push_back(volume_->texture_of(node));
  bool any = false;
  std::array<float, 2> all{static_cast<float>(kGreatestHu), static_cast<float>(kLeastHu)};
  for (std::size_t t = 0; t < rest.tetrahedra.size(); ++t) {
    std::array<Vector3, 4> corners;
    for (std::size_t corner = 0; corner < 4; ++corner)
      corners[corner] = rest.nodes[rest.tetrahedra[t][corner]];
    const std::array<float, 2> range = hu_range(*volume_, corners);
    all = {std::min(all[0], range[0]), std::max(all[1], range[1])};
    if (transfer_.shows(double{range[0]}, double{range[1]})) {
      any = true;
    } else {
      mesh->topology.cells[t].nodes[0] |= kEmptyCell;
    }
  }
  if (!any) {
    const std::array<int, 2> visible = transfer_.visible_hu();
    throw Error("the transfer function '" + transfer_.name + "' hides everything: it shows " +
                std::to_string(visible[0]) + " to " + std::to_string(visible[1]) +
                " HU, and the CT in the mesh has " + number_text(std::round(double{all[0]})) + " to " +
                number_text(std::round(double{all[1]})) +
                " HU; choose another (--transfer), or look at whether the mesh belongs to this CT");
  }
  mesh_ = std::move(mesh);
  if (caster_) return caster_->set_mesh(*mesh_);
  try {
    drawing_->set_mesh(*mesh_);
  } catch (const Error& error) {
    if (!is_on_gpu()) throw;
    go_on_in_software(error.what());
  }
}

namespace {

void require_optics(const Scene& scene) {
  if (scene.tip_light) {
    const TipLight& tip = *scene.tip_light;
    if (!tip.at_m.allFinite() || !std::isfinite(tip.working_distance_m) || !(tip.working_distance_m > 0))
      throw UsageError("the light at the tip must have a place, and a working distance greater than 0");
    if (!(tip.wet >= 0 && tip.wet <= 1) || !(tip.roughness > 0 && tip.roughness <= 1))
      throw UsageError("tissue is wet from 0 to 1, and its film rough from more than 0 to 1");
  }
  if (!scene.lens) return;
  if (scene.camera.parallel) throw UsageError("a lens has no parallel rays: draw it in perspective");
  if (scene.lens->width() != scene.width || scene.lens->height() != scene.height) {
    throw UsageError("the lens's rays are of a picture of " + std::to_string(scene.lens->width()) + "x" +
                     std::to_string(scene.lens->height()) + " pixels, not of one of " +
                     std::to_string(scene.width) + "x" + std::to_string(scene.height));
  }
}

}  // namespace

Picture VolumeRenderer::render(std::span<const double> displacement_m, const Scene& scene) {
  if (!mesh_) throw UsageError("nothing can be drawn before there is a mesh");
  if (scene.width < 1 || scene.height < 1 || scene.width > kLargestPictureSide ||
      scene.height > kLargestPictureSide) {
    throw UsageError("a picture of " + std::to_string(scene.width) + "x" + std::to_string(scene.height) +
                     " pixels cannot be drawn: sides must be from 1 to 8192");
  }
  const std::size_t nodes = mesh_->rest.nodes.size();
  if (!displacement_m.empty() && displacement_m.size() != 3 * nodes) {
    throw UsageError("a mesh of " + std::to_string(nodes) + " nodes was given displacements of " +
                     std::to_string(displacement_m.size() / 3));
  }
  if (!std::ranges::all_of(displacement_m, [](double value) { return std::isfinite(value); }))
    throw UsageError("displacements that are no numbers cannot be drawn");
  if (scene.stress && (scene.stress->at_nodes_pa.size() != nodes || !(scene.stress->largest_pa > 0)))
    throw UsageError("a stress must be given for each node, with a largest that is greater than 0");
  require_optics(scene);
  mesh_->place_nodes(displacement_m, scene.camera);
  Picture picture = drawn(scene);
  if (scene.round) blacken_beyond_disc(picture);
  return picture;
}

Picture VolumeRenderer::drawn(const Scene& scene) {
  // By a light at the tip, slices of skin are as steep as they are seen on.
  const double still_m = volume_->spacing_m * Scene::kVoxelShare;
  const double fine_m = scene.tip_light ? std::min(still_m, Scene::kTipSpacingM) : still_m;
  const double own_m = scene.moving ? volume_->spacing_m * Scene::kMovingVoxelShare : fine_m;
  const double spacing_m = scene.spacing_m > 0 ? scene.spacing_m : own_m;
  if (drawing_) {
    try {
      return drawing_->draw(*mesh_, scene, spacing_m);
    } catch (const Error& error) {
      if (!is_on_gpu()) throw;
      go_on_in_software(error.what());
    }
  }
  if (drawing_) return drawing_->draw(*mesh_, scene, spacing_m);
  mesh_->place_cells(scene.camera);
  return caster_->draw(*mesh_, scene, spacing_m);
}

std::vector<double> at_nodes(const TetMesh& mesh, std::span<const double> of_tetrahedra) {
  std::vector<double> sum(mesh.nodes.size()), weight(mesh.nodes.size());
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    const double volume = std::abs(signed_volume_m3(mesh, t));
    for (const std::uint32_t node : mesh.tetrahedra[t]) {
      sum[node] += volume * of_tetrahedra[t];
      weight[node] += volume;
    }
  }
  for (std::size_t node = 0; node < sum.size(); ++node)
    sum[node] = weight[node] > 0 ? sum[node] / weight[node] : 0;
  return sum;
}

}  // namespace kiroku::sim

// Objects of OpenGL as handles that free themselves. Each belongs to the context that was current when it was
// made, which must outlive it and be current again when it is used and freed.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <utility>

#include "sim/render/gl_functions.h"

namespace kiroku::sim {

/// Deletes by one of the functions of the table.
class GlHandle {
 public:
  using Delete = void (*)(const GlFunctions& gl, GLuint name);
  GlHandle() = default;
  GlHandle(const GlFunctions& gl, GLuint name, Delete remove) : gl_(&gl), name_(name), delete_(remove) {}
  ~GlHandle() {
    if (name_ != 0) delete_(*gl_, name_);
  }
  GlHandle(GlHandle&& other) noexcept
      : gl_(other.gl_), name_(std::exchange(other.name_, 0)), delete_(other.delete_) {}
  GlHandle& operator=(GlHandle&& other) noexcept {
    std::swap(gl_, other.gl_);
    std::swap(name_, other.name_);
    std::swap(delete_, other.delete_);
    return *this;
  }
  GlHandle(const GlHandle&) = delete;
  GlHandle& operator=(const GlHandle&) = delete;
  [[nodiscard]] GLuint name() const { return name_; }

 private:
  const GlFunctions* gl_ = nullptr;
  GLuint name_ = 0;
  Delete delete_ = nullptr;
};

GlHandle make_buffer(const GlFunctions& gl);
GlHandle make_texture(const GlFunctions& gl, GLenum target);
GlHandle make_framebuffer(const GlFunctions& gl);
GlHandle make_vertex_array(const GlFunctions& gl);
GlHandle make_query(const GlFunctions& gl, GLenum target);
/// kiroku::Error with the compiler's own words: a driver that cannot.
GlHandle make_program(const GlFunctions& gl, const std::string& vertex_shader,
                      const std::string& fragment_shader);
GlHandle make_compute_program(const GlFunctions& gl, const std::string& shader);

/// Fills a buffer with `values`; an empty one gets a few bytes, as a shader's block must have some.
template <typename Value>
void fill_buffer(const GlFunctions& gl, const GlHandle& buffer, std::span<const Value> values) {
  constexpr GLsizeiptr kLeast = 16;
  if (values.empty()) {
    gl.NamedBufferData(buffer.name(), kLeast, nullptr, GL_DYNAMIC_DRAW);
  } else {
    gl.NamedBufferData(buffer.name(), static_cast<GLsizeiptr>(values.size_bytes()), values.data(),
                       GL_DYNAMIC_DRAW);
  }
}

/// Nearest texel, clamped to the edge; what the textures of numbers want.
void sample_nearest(const GlFunctions& gl, const GlHandle& texture);

}  // namespace kiroku::sim

#include "sim/render/gl_objects.h"

#include <array>
#include <vector>

#include "base/error.h"

namespace kiroku::sim {
namespace {

GlHandle compiled(const GlFunctions& gl, GLenum kind, const std::string& source) {
  GlHandle shader(gl, gl.CreateShader(kind),
                  [](const GlFunctions& functions, GLuint name) { functions.DeleteShader(name); });
  const char* const text = source.c_str();
  gl.ShaderSource(shader.name(), 1, &text, nullptr);
  gl.CompileShader(shader.name());
  GLint done = GL_FALSE;
  gl.GetShaderiv(shader.name(), GL_COMPILE_STATUS, &done);
  if (done == GL_FALSE) {
    std::vector<char> log(4096);
    gl.GetShaderInfoLog(shader.name(), static_cast<GLsizei>(log.size()), nullptr, log.data());
    throw Error("the OpenGL driver cannot compile a shader: " + std::string(log.data()));
  }
  return shader;
}

GlHandle linked(const GlFunctions& gl, std::span<const GlHandle> shaders) {
  GlHandle program(gl, gl.CreateProgram(),
                   [](const GlFunctions& functions, GLuint name) { functions.DeleteProgram(name); });
  for (const GlHandle& shader : shaders) gl.AttachShader(program.name(), shader.name());
  gl.LinkProgram(program.name());
  GLint done = GL_FALSE;
  gl.GetProgramiv(program.name(), GL_LINK_STATUS, &done);
  if (done == GL_FALSE) {
    std::vector<char> log(4096);
    gl.GetProgramInfoLog(program.name(), static_cast<GLsizei>(log.size()), nullptr, log.data());
    throw Error("the OpenGL driver cannot link a program: " + std::string(log.data()));
  }
  return program;
}

}  // namespace

GlHandle make_buffer(const GlFunctions& gl) {
  GLuint name = 0;
  gl.CreateBuffers(1, &name);
  return {gl, name, [](const GlFunctions& functions, GLuint object) { functions.DeleteBuffers(1, &object); }};
}

GlHandle make_texture(const GlFunctions& gl, GLenum target) {
  GLuint name = 0;
  gl.CreateTextures(target, 1, &name);
  return {gl, name,
          [](const GlFunctions& functions, GLuint object) { functions.DeleteTextures(1, &object); }};
}

GlHandle make_framebuffer(const GlFunctions& gl) {
  GLuint name = 0;
  gl.CreateFramebuffers(1, &name);
  return {gl, name,
          [](const GlFunctions& functions, GLuint object) { functions.DeleteFramebuffers(1, &object); }};
}

GlHandle make_vertex_array(const GlFunctions& gl) {
  GLuint name = 0;
  gl.CreateVertexArrays(1, &name);
  return {gl, name,
          [](const GlFunctions& functions, GLuint object) { functions.DeleteVertexArrays(1, &object); }};
}

GlHandle make_query(const GlFunctions& gl, GLenum target) {
  GLuint name = 0;
  gl.CreateQueries(target, 1, &name);
  return {gl, name, [](const GlFunctions& functions, GLuint object) { functions.DeleteQueries(1, &object); }};
}

GlHandle make_program(const GlFunctions& gl, const std::string& vertex_shader,
                      const std::string& fragment_shader) {
  const std::array shaders{compiled(gl, GL_VERTEX_SHADER, vertex_shader),
                           compiled(gl, GL_FRAGMENT_SHADER, fragment_shader)};
  return linked(gl, shaders);
}

GlHandle make_compute_program(const GlFunctions& gl, const std::string& shader) {
  const std::array shaders{compiled(gl, GL_COMPUTE_SHADER, shader)};
  return linked(gl, shaders);
}

void sample_nearest(const GlFunctions& gl, const GlHandle& texture) {
  gl.TextureParameteri(texture.name(), GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  gl.TextureParameteri(texture.name(), GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  gl.TextureParameteri(texture.name(), GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl.TextureParameteri(texture.name(), GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
}

}  // namespace kiroku::sim

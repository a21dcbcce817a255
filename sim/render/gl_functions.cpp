#include "sim/render/gl_functions.h"

#include "base/error.h"

namespace kiroku::sim {
namespace {

std::string text_of(GLenum error) {
  switch (error) {
    case GL_OUT_OF_MEMORY:
      return "OpenGL ran out of memory";
    case GL_INVALID_FRAMEBUFFER_OPERATION:
      return "OpenGL cannot draw into such a picture";
    default:
      return "OpenGL refused a call (error " + std::to_string(error) + ")";
  }
}

}  // namespace

GlFunctions load_gl(const GlLoader& loader, const std::string& from) {
  GlFunctions gl;
  const auto load = [&]<typename Function>(Function& function, const char* name) {
    function = reinterpret_cast<Function>(loader(name));
    if (function == nullptr)
      throw Error(from + " lacks " + name + ", which OpenGL 4.5 has: install a newer driver");
  };
#define KIROKU_GL_LOAD(Type, Name) load(gl.Name, "gl" #Name);
  KIROKU_GL_FUNCTIONS(KIROKU_GL_LOAD)
#undef KIROKU_GL_LOAD
  return gl;
}

void check_gl(const GlFunctions& gl, const std::string& what) {
  const GLenum error = gl.GetError();
  if (error == GL_NO_ERROR) return;
  // Others may wait behind it, for this call alone to tell of. A context that is lost has no end of them.
  for (int left = 0; left < 16 && gl.GetError() != GL_NO_ERROR; ++left) {
  }
  throw Error("cannot " + what + ": " + text_of(error));
}

}  // namespace kiroku::sim

#include "sim/render/gl_context.h"

#include "base/error.h"

namespace kiroku::sim {
namespace {

thread_local GlContext* current = nullptr;

}  // namespace

void GlContext::make_current() {
  if (current == this) return;
  if (current != nullptr) current->release();
  current = nullptr;
  bind();
  current = this;
}

void GlContext::leave() noexcept {
  if (current != this) return;
  release();
  current = nullptr;
}

void GlContext::load(const GlLoader& loader, const std::string& from) {
  gl_ = load_gl(loader, from);
  const auto text = [&](GLenum name) {
    const GLubyte* const found = gl_.GetString(name);
    return found == nullptr ? std::string() : std::string(reinterpret_cast<const char*>(found));
  };
  renderer_ = text(GL_RENDERER);
  GLint major = 0, minor = 0;
  gl_.GetIntegerv(GL_MAJOR_VERSION, &major);
  gl_.GetIntegerv(GL_MINOR_VERSION, &minor);
  constexpr int kTen = 10;
  if (kTen * major + minor < 45) {
    throw Error(renderer_ + " offers OpenGL " + text(GL_VERSION) + "; 4.5 is needed: install a newer driver");
  }
}

ChosenContext choose_context(GpuUse use, const GpuMaker& make_gpu) {
  ChosenContext chosen;
  if (use == GpuUse::kAuto) {
    try {
      chosen.context = make_gpu();
    } catch (const Error& error) {
      chosen.notice = std::string("the graphics processor is not used, pictures are computed in software: ") +
                      error.what();
    }
  }
  if (!chosen.context) chosen.context = make_software_context();
  return chosen;
}

}  // namespace kiroku::sim

// OSMesa: Mesa's software rasteriser, which draws into memory.

// Before osmesa.h, whose gl.h leaves out types that a header of OpenGL 4.5 has.
#include <GL/glcorearb.h>
#include <GL/osmesa.h>
#include <array>

#include "base/error.h"
#include "sim/render/dynamic_library.h"
#include "sim/render/gl_context.h"

namespace kiroku::sim {
namespace {

constexpr const char* kOsMesaLibrary = "libOSMesa.so.8";

struct OsMesa {
  DynamicLibrary library{kOsMesaLibrary};
  decltype(&OSMesaCreateContextAttribs) create =
      library.function<decltype(&OSMesaCreateContextAttribs)>("OSMesaCreateContextAttribs");
  decltype(&OSMesaDestroyContext) destroy =
      library.function<decltype(&OSMesaDestroyContext)>("OSMesaDestroyContext");
  decltype(&OSMesaMakeCurrent) make_current =
      library.function<decltype(&OSMesaMakeCurrent)>("OSMesaMakeCurrent");
  decltype(&OSMesaGetProcAddress) address =
      library.function<decltype(&OSMesaGetProcAddress)>("OSMesaGetProcAddress");
  [[nodiscard]] bool is_whole() const {
    return create != nullptr && destroy != nullptr && make_current != nullptr && address != nullptr;
  }
};

class SoftwareContext : public GlContext {
 public:
  SoftwareContext() {
    if (!mesa_.is_whole()) {
      throw Error(std::string("pictures need ") + kOsMesaLibrary +
                  ", which is not here: install Debian's libosmesa6, or use a graphics processor");
    }
    const std::array<int, 11> attributes{OSMESA_FORMAT,
                                         OSMESA_RGBA,
                                         OSMESA_PROFILE,
                                         OSMESA_CORE_PROFILE,
                                         OSMESA_CONTEXT_MAJOR_VERSION,
                                         4,
                                         OSMESA_CONTEXT_MINOR_VERSION,
                                         5,
                                         0,
                                         0};
    context_ = mesa_.create(attributes.data(), nullptr);
    if (context_ == nullptr) {
      throw Error(std::string(kOsMesaLibrary) + " gives no OpenGL 4.5 context: install Debian's libosmesa6");
    }
    try {
      make_current();
      load([this](const char* name) { return reinterpret_cast<void*>(mesa_.address(name)); }, kOsMesaLibrary);
    } catch (...) {
      leave();
      mesa_.destroy(context_);
      throw;
    }
  }
  ~SoftwareContext() override {
    leave();
    mesa_.destroy(context_);
  }
  SoftwareContext(const SoftwareContext&) = delete;
  SoftwareContext& operator=(const SoftwareContext&) = delete;

  [[nodiscard]] bool is_software() const override { return true; }

 private:
  void bind() override {
    if (mesa_.make_current(context_, screen_.data(), GL_UNSIGNED_BYTE, kSide, kSide) == 0)
      throw Error(std::string(kOsMesaLibrary) +
                  " cannot use its own context: install Debian's libosmesa6 anew");
  }
  void release() noexcept override { mesa_.make_current(nullptr, nullptr, GL_UNSIGNED_BYTE, 0, 0); }

  // A screen it must have; nothing is drawn there.
  static constexpr int kSide = 4;
  OsMesa mesa_;
  OSMesaContext context_ = nullptr;
  std::array<unsigned char, std::size_t{4} * kSide * kSide> screen_{};
};

}  // namespace

std::unique_ptr<GlContext> make_software_context() { return std::make_unique<SoftwareContext>(); }

}  // namespace kiroku::sim

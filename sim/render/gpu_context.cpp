// EGL on a device, as a server without any display has it.

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <array>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "sim/render/dynamic_library.h"
#include "sim/render/gl_context.h"

namespace kiroku::sim {
namespace {

constexpr const char* kEglLibrary = "libEGL.so.1";

struct Egl {
  DynamicLibrary library{kEglLibrary};
  PFNEGLGETPROCADDRESSPROC address = library.function<PFNEGLGETPROCADDRESSPROC>("eglGetProcAddress");
  PFNEGLQUERYDEVICESEXTPROC query_devices = find<PFNEGLQUERYDEVICESEXTPROC>("eglQueryDevicesEXT");
  PFNEGLQUERYDEVICESTRINGEXTPROC device_string =
      find<PFNEGLQUERYDEVICESTRINGEXTPROC>("eglQueryDeviceStringEXT");
  PFNEGLGETPLATFORMDISPLAYEXTPROC platform_display =
      find<PFNEGLGETPLATFORMDISPLAYEXTPROC>("eglGetPlatformDisplayEXT");
  PFNEGLINITIALIZEPROC initialize = find<PFNEGLINITIALIZEPROC>("eglInitialize");
  PFNEGLBINDAPIPROC bind_api = find<PFNEGLBINDAPIPROC>("eglBindAPI");
  PFNEGLCHOOSECONFIGPROC choose_config = find<PFNEGLCHOOSECONFIGPROC>("eglChooseConfig");
  PFNEGLCREATECONTEXTPROC create_context = find<PFNEGLCREATECONTEXTPROC>("eglCreateContext");
  PFNEGLDESTROYCONTEXTPROC destroy_context = find<PFNEGLDESTROYCONTEXTPROC>("eglDestroyContext");
  PFNEGLMAKECURRENTPROC make_current = find<PFNEGLMAKECURRENTPROC>("eglMakeCurrent");
  PFNEGLGETERRORPROC error = find<PFNEGLGETERRORPROC>("eglGetError");

  [[nodiscard]] bool is_whole() const {
    return query_devices != nullptr && device_string != nullptr && platform_display != nullptr &&
           initialize != nullptr && bind_api != nullptr && choose_config != nullptr &&
           create_context != nullptr && destroy_context != nullptr && make_current != nullptr &&
           error != nullptr;
  }

 private:
  template <typename Function>
  [[nodiscard]] Function find(const char* name) const {
    if (const auto exported = library.function<Function>(name); exported != nullptr) return exported;
    return address == nullptr ? nullptr : reinterpret_cast<Function>(address(name));
  }
};

class GpuContext : public GlContext {
 public:
  GpuContext(const Egl& egl, EGLDeviceEXT device, bool software) : egl_(egl), software_(software) {
    try {
      open(device);
    } catch (...) {
      close();
      throw;
    }
  }
  ~GpuContext() override { close(); }
  GpuContext(const GpuContext&) = delete;
  GpuContext& operator=(const GpuContext&) = delete;

  [[nodiscard]] bool is_software() const override { return software_; }

 private:
  void bind() override {
    // Which interface is bound is the thread's business, and others may have changed it.
    if (egl_.bind_api(EGL_OPENGL_API) == EGL_FALSE ||
        egl_.make_current(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) == EGL_FALSE)
      fail("its context cannot be used");
  }
  void release() noexcept override {
    egl_.make_current(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  }

  void open(EGLDeviceEXT device) {
    display_ = egl_.platform_display(EGL_PLATFORM_DEVICE_EXT, device, nullptr);
    if (display_ == EGL_NO_DISPLAY || egl_.initialize(display_, nullptr, nullptr) == EGL_FALSE)
      fail("its device cannot be opened");
    if (egl_.bind_api(EGL_OPENGL_API) == EGL_FALSE) fail("it has no OpenGL");
    const std::array<EGLint, 5> wanted{EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT,
                                       EGL_NONE};
    EGLConfig config = nullptr;
    EGLint count = 0;
    if (egl_.choose_config(display_, wanted.data(), &config, 1, &count) == EGL_FALSE || count == 0)
      fail("it has no configuration for OpenGL");
    const std::array<EGLint, 7> attributes{EGL_CONTEXT_MAJOR_VERSION,
                                           4,
                                           EGL_CONTEXT_MINOR_VERSION,
                                           5,
                                           EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                           EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                           EGL_NONE};
    context_ = egl_.create_context(display_, config, EGL_NO_CONTEXT, attributes.data());
    if (context_ == EGL_NO_CONTEXT) fail("it gives no OpenGL 4.5 context");
    make_current();
    load([this](const char* name) { return reinterpret_cast<void*>(egl_.address(name)); }, kEglLibrary);
  }

  void close() noexcept {
    leave();
    if (context_ != EGL_NO_CONTEXT) egl_.destroy_context(display_, context_);
    // All contexts of a device have the same display, which therefore is not terminated.
  }

  [[noreturn]] void fail(const std::string& what) const {
    std::array<char, 16> code{};
    std::snprintf(code.data(), code.size(), "0x%04x", static_cast<unsigned>(egl_.error()));
    throw Error(what + " (EGL error " + code.data() + "); look at its driver");
  }

  Egl egl_;
  bool software_;
  EGLDisplay display_ = EGL_NO_DISPLAY;
  EGLContext context_ = EGL_NO_CONTEXT;
};

bool is_software(const Egl& egl, EGLDeviceEXT device) {
  const char* const extensions = egl.device_string(device, EGL_EXTENSIONS);
  return extensions != nullptr &&
         std::string_view(extensions).find("EGL_MESA_device_software") != std::string_view::npos;
}

}  // namespace

std::unique_ptr<GlContext> make_gpu_context(bool software_too) {
  const Egl egl;
  if (!egl.is_whole()) return nullptr;
  constexpr EGLint kMost = 32;
  std::array<EGLDeviceEXT, kMost> devices{};
  EGLint count = 0;
  if (egl.query_devices(kMost, devices.data(), &count) == EGL_FALSE) return nullptr;
  std::string failure;
  for (EGLint i = 0; i < count; ++i) {
    const EGLDeviceEXT device = devices[static_cast<std::size_t>(i)];
    const bool software = is_software(egl, device);
    if (software && !software_too) continue;
    try {
      auto context = std::make_unique<GpuContext>(egl, device, software);
      // A driver without its hardware draws in software too, and says so only in its name.
      const bool pretends = context->renderer().find("llvmpipe") != std::string::npos ||
                            context->renderer().find("softpipe") != std::string::npos;
      if (!pretends || software_too) return context;
    } catch (const Error& error) {
      if (failure.empty()) failure = error.what();
    }
  }
  if (!failure.empty()) throw Error(failure);
  return nullptr;
}

}  // namespace kiroku::sim

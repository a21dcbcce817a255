// Where pictures are computed: an OpenGL 4.5 core context without any window or screen. In software
// everywhere (OSMesa), on a graphics processor where one is there (EGL on its device). Both libraries are
// opened when a context is made, so that nothing else of the project needs them.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "sim/render/gl_functions.h"

namespace kiroku::sim {

enum class GpuUse {
  kAuto,  // a graphics processor where one is there and works, else software
  kOff,   // software: the reference, the same bytes whatever the number of threads
};

/// A context belongs to the thread that made it, where it is current until another is made or made current.
/// Who switches between contexts does so by make_current() alone: libraries do not know of each other's.
class GlContext {
 public:
  GlContext() = default;
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;
  virtual ~GlContext() = default;

  /// kiroku::Error if it cannot be.
  void make_current();
  [[nodiscard]] virtual bool is_software() const = 0;
  [[nodiscard]] const GlFunctions& gl() const { return gl_; }
  /// As the driver names itself: "llvmpipe (LLVM 15.0.6, 256 bits)".
  [[nodiscard]] const std::string& renderer() const { return renderer_; }

 protected:
  virtual void bind() = 0;
  virtual void release() noexcept = 0;
  /// To be called by destructors: releases it where it is current.
  void leave() noexcept;
  /// Loads the table in the context that is current; kiroku::Error as load_gl(), and for less than 4.5.
  void load(const GlLoader& loader, const std::string& from);

 private:
  GlFunctions gl_;
  std::string renderer_;
};

/// kiroku::Error with what to install.
std::unique_ptr<GlContext> make_software_context();

/// On the first graphics processor that EGL knows and that gives a context; nullptr where EGL or such a
/// processor is not there. kiroku::Error where one is there and fails. `software_too`: also what only
/// pretends to be one (Mesa's own devices).
std::unique_ptr<GlContext> make_gpu_context(bool software_too = false);

struct ChosenContext {
  std::unique_ptr<GlContext> context;
  std::string notice;  // why it is not the graphics processor that is there; empty where nothing failed
};
using GpuMaker = std::function<std::unique_ptr<GlContext>()>;
/// By what is wanted and what is there; kiroku::Error as make_software_context(). `make_gpu` for tests.
ChosenContext choose_context(
    GpuUse use, const GpuMaker& make_gpu = [] { return make_gpu_context(); });

}  // namespace kiroku::sim

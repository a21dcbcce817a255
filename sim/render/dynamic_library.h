// A shared library that is opened when it is needed. Immutable; thread-safe.
#pragma once

#include <dlfcn.h>

namespace kiroku::sim {

/// Never closed: drivers leave threads and handlers behind that would return into nothing.
class DynamicLibrary {
 public:
  /// `name` as the loader seeks it: "libEGL.so.1".
  explicit DynamicLibrary(const char* name) : handle_(::dlopen(name, RTLD_NOW | RTLD_LOCAL)) {}
  [[nodiscard]] bool is_there() const { return handle_ != nullptr; }
  /// nullptr where the library has no such function.
  template <typename Function>
  [[nodiscard]] Function function(const char* name) const {
    return is_there() ? reinterpret_cast<Function>(::dlsym(handle_, name)) : nullptr;
  }

 private:
  void* handle_;
};

}  // namespace kiroku::sim

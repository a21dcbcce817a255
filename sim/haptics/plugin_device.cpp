#include "sim/haptics/plugin_device.h"

#include <array>
#include <dlfcn.h>

#include "base/error.h"

namespace kiroku::sim {

struct PluginDevice::Library {
  struct Close {
    void operator()(void* library) const { ::dlclose(library); }
  };
  std::unique_ptr<void, Close> handle;
};

PluginDevice::PluginDevice(std::size_t tools, const std::filesystem::path& library,
                           const std::string& argument)
    : library_(std::make_unique<Library>()), poses_(tools), forces_(tools) {
  if (tools == 0 || tools > kMostTools)
    throw UsageError("a plug-in has 1 to " + std::to_string(kMostTools) + " tools, not " +
                     std::to_string(tools));
  const std::string name = "the haptic plug-in " + library.string();
  // From the folder one stands in, as every other file; a bare name would be sought in the system's folders.
  library_->handle.reset(::dlopen(std::filesystem::absolute(library).c_str(), RTLD_NOW | RTLD_LOCAL));
  if (!library_->handle) {
    const char* const why = ::dlerror();
    throw Error(name + " cannot be loaded: " + (why == nullptr ? "no reason was given" : why));
  }
  void* const symbol = ::dlsym(library_->handle.get(), "kiroku_haptic_plugin");
  if (symbol == nullptr)
    throw Error(name + " is a library, but exports no kiroku_haptic_plugin: it is no plug-in");
  try {
    plugin_ = reinterpret_cast<decltype(&kiroku_haptic_plugin)>(symbol)();
  } catch (...) {
    throw Error(name + " let an exception out when it was asked for its table");
  }
  if (plugin_ == nullptr) throw Error(name + " gave no table of functions");
  if (plugin_->abi != KIROKU_HAPTIC_ABI)
    throw Error(name + " was made for ABI " + std::to_string(plugin_->abi) + ", and this program has " +
                std::to_string(KIROKU_HAPTIC_ABI) + ": build it with this program's haptic_plugin.h");
  if (plugin_->open == nullptr || plugin_->read == nullptr || plugin_->write == nullptr ||
      plugin_->close == nullptr)
    throw Error(name + " has a table with a function missing");
  std::array<char, 512> error{};
  try {
    device_ = plugin_->open(argument.c_str(), static_cast<std::uint32_t>(tools), error.data(), error.size());
  } catch (...) {
    throw Error(name + " let an exception out when it opened its device");
  }
  if (device_ == nullptr) {
    error.back() = 0;
    throw Error(name + " cannot open its device: " + (error[0] == 0 ? "it says no reason" : error.data()));
  }
}

PluginDevice::~PluginDevice() {
  try {
    plugin_->close(device_);
  } catch (...) {
    lose("let an exception out when it closed");
  }
}

void PluginDevice::lose(const char* why) {
  why_lost_ = why;
  lost_ = true;
}

bool PluginDevice::read(std::span<Pose> poses) {
  if (lost_) return false;
  int answer = KIROKU_HAPTIC_LOST;
  try {
    answer = plugin_->read(device_, poses_.data());
  } catch (...) {
    lose("let an exception out");
    return false;
  }
  if (answer < 0) lose("said that its device is lost");
  if (answer != KIROKU_HAPTIC_DONE) return false;
  for (std::size_t tool = 0; tool < poses_.size(); ++tool) {
    const double* const p = poses_[tool].position_m;
    const double* const q = poses_[tool].orientation;
    poses[tool].position_m = {p[0], p[1], p[2]};
    poses[tool].orientation = {q[0], q[1], q[2], q[3]};
  }
  return true;
}

void PluginDevice::write(std::span<const Vector3> forces_n) {
  if (lost_) return;
  for (std::size_t tool = 0; tool < forces_.size(); ++tool) {
    for (std::size_t i = 0; i < 3; ++i) forces_[tool].n[i] = forces_n[tool][static_cast<Eigen::Index>(i)];
  }
  try {
    if (plugin_->write(device_, forces_.data()) < 0) lose("said that its device is lost");
  } catch (...) {
    lose("let an exception out");
  }
}

}  // namespace kiroku::sim

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

namespace {

/// The library's table, checked; null where it does not export that function. `name` is for errors.
template <typename Table>
const Table* table_of(void* library, const char* function, std::uint32_t abi, const std::string& name) {
  void* const symbol = ::dlsym(library, function);
  if (symbol == nullptr) return nullptr;
  const Table* table = nullptr;
  try {
    table = reinterpret_cast<const Table* (*)()>(symbol)();
  } catch (...) {
    throw Error(name + " let an exception out when it was asked for its table");
  }
  if (table == nullptr) throw Error(name + " gave no table of functions");
  if (table->abi != abi)
    throw Error(name + " was made for ABI " + std::to_string(table->abi) + ", and " + function +
                " is for ABI " + std::to_string(abi) + ": build it with this program's haptic_plugin.h");
  if (table->open == nullptr || table->read == nullptr || table->write == nullptr || table->close == nullptr)
    throw Error(name + " has a table with a function missing");
  return table;
}

Pose pose_of(const KirokuHapticPose& given) {
  const double* const p = given.position_m;
  const double* const q = given.orientation;
  return {{p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]}};
}

void put(double* to, const Vector3& vector) {
  for (std::size_t i = 0; i < 3; ++i) to[i] = vector[static_cast<Eigen::Index>(i)];
}

}  // namespace

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
  void* const handle = library_->handle.get();
  with_wrist_ = table_of<KirokuHapticPlugin2>(handle, "kiroku_haptic_plugin_2", KIROKU_HAPTIC_ABI_2, name);
  if (with_wrist_ == nullptr)
    plugin_ = table_of<KirokuHapticPlugin>(handle, "kiroku_haptic_plugin", KIROKU_HAPTIC_ABI, name);
  if (with_wrist_ == nullptr && plugin_ == nullptr)
    throw Error(name +
                " is a library, but exports neither kiroku_haptic_plugin_2 nor kiroku_haptic_plugin: "
                "it is no plug-in");
  const auto open = with_wrist_ != nullptr ? with_wrist_->open : plugin_->open;
  std::array<char, 512> error{};
  try {
    device_ = open(argument.c_str(), static_cast<std::uint32_t>(tools), error.data(), error.size());
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
    (with_wrist_ != nullptr ? with_wrist_->close : plugin_->close)(device_);
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
  KirokuHapticPose wrist{};
  try {
    answer = with_wrist_ != nullptr ? with_wrist_->read(device_, poses_.data(), &wrist)
                                    : plugin_->read(device_, poses_.data());
  } catch (...) {
    lose("let an exception out");
    return false;
  }
  if (answer < 0) lose("said that its device is lost");
  if (answer != KIROKU_HAPTIC_DONE) return false;
  for (std::size_t tool = 0; tool < poses_.size(); ++tool) poses[tool] = pose_of(poses_[tool]);
  if (has_wrist()) wrist_ = pose_of(wrist);
  return true;
}

void PluginDevice::write(std::span<const Vector3> forces_n) {
  if (lost_) return;
  for (std::size_t tool = 0; tool < forces_.size(); ++tool) put(forces_[tool].n, forces_n[tool]);
  KirokuHapticWristForce wrist{};
  put(wrist.n, wrist_force_.force_n);
  put(wrist.nm, wrist_force_.torque_nm);
  try {
    const int answer = with_wrist_ != nullptr ? with_wrist_->write(device_, forces_.data(), &wrist)
                                              : plugin_->write(device_, forces_.data());
    if (answer < 0) lose("said that its device is lost");
  } catch (...) {
    lose("let an exception out");
  }
}

}  // namespace kiroku::sim

// A haptic device that a shared library drives (sim/haptics/haptic_plugin.h).
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "sim/haptics/haptic_device.h"
#include "sim/haptics/haptic_plugin.h"

namespace kiroku::sim {

/// read() and write() are for the force loop's thread; lost() and why_lost() for any. A plug-in that says its
/// device is lost, or lets an exception out, is asked and given nothing more.
class PluginDevice : public HapticDevice {
 public:
  /// Loads the library and opens its device, by version 2 of its table where it has one, else by version 1.
  /// kiroku::Error in one sentence for what is no library, has neither table, is of another ABI, has a table
  /// with holes, or cannot open its device; kiroku::UsageError for no tools or more than kMostTools.
  PluginDevice(std::size_t tools, const std::filesystem::path& library, const std::string& argument);
  ~PluginDevice() override;
  PluginDevice(const PluginDevice&) = delete;
  PluginDevice& operator=(const PluginDevice&) = delete;

  static constexpr std::size_t kMostTools = 16;

  [[nodiscard]] std::size_t tools() const override { return poses_.size(); }
  /// Poses as the plug-in gives them, sound or not: to be used behind what checks them.
  bool read(std::span<Pose> poses) override;
  void write(std::span<const Vector3> forces_n) override;
  [[nodiscard]] bool has_wrist() const override { return with_wrist_ != nullptr; }
  [[nodiscard]] Pose wrist() const override { return wrist_; }
  void write_wrist(const WristForce& wrist) override { wrist_force_ = wrist; }

  [[nodiscard]] bool lost() const { return lost_; }
  /// A sentence's end, "said that its device is lost"; empty while it is there.
  [[nodiscard]] std::string why_lost() const { return lost_ ? why_lost_.load() : ""; }

 private:
  struct Library;
  void lose(const char* why);

  std::unique_ptr<Library> library_;
  /// One of them is there.
  const KirokuHapticPlugin* plugin_ = nullptr;
  const KirokuHapticPlugin2* with_wrist_ = nullptr;
  Pose wrist_;
  WristForce wrist_force_;
  void* device_ = nullptr;
  std::vector<KirokuHapticPose> poses_;
  std::vector<KirokuHapticForce> forces_;
  std::atomic<const char*> why_lost_ = "";
  std::atomic<bool> lost_ = false;
};

}  // namespace kiroku::sim

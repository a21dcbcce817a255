// Haptic plug-ins that fail, for tests: of version 1, or with a wrist of version 2 (KIROKU_TEST_WRIST) or of
// both (KIROKU_TEST_BOTH); built without what is exported (KIROKU_TEST_NO_SYMBOL), for another ABI
// (KIROKU_TEST_ABI), without a function (KIROKU_TEST_NO_WRITE), or as the argument says after a hundred
// poses: "nan", "jump", "throw", "lose"; "nan wrist", "jump wrist". With "echo" the poses say what was
// written.
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>

#include "sim/haptics/haptic_plugin.h"

#ifndef KIROKU_TEST_ABI
#ifdef KIROKU_TEST_WRIST
#define KIROKU_TEST_ABI KIROKU_HAPTIC_ABI_2
#else
#define KIROKU_TEST_ABI KIROKU_HAPTIC_ABI
#endif
#endif

namespace {

struct Device {
  std::string fault;
  std::uint32_t fingers;
  int reads = 0;
  KirokuHapticForce first{};
  KirokuHapticWristForce wrist{};
};

void* open_device(const char* argument, std::uint32_t fingers, char* error, std::size_t size) {
  if (std::string(argument) == "refuse") {
    std::strncpy(error, "nothing is plugged in", size - 1);
    return nullptr;
  }
  return new Device{argument, fingers};
}

int read_poses(void* opened, KirokuHapticPose* poses) {
  auto& device = *static_cast<Device*>(opened);
  const bool fails = ++device.reads > 100;
  if (fails && device.fault == "throw") throw std::runtime_error("out of a plug-in");
  if (fails && device.fault == "lose") return KIROKU_HAPTIC_LOST;
  for (std::uint32_t i = 0; i < device.fingers; ++i) {
    poses[i] = {{0.01 * i, 0, -0.05}, {1, 0, 0, 0}};
    if (fails && device.fault == "nan") poses[i].position_m[1] = std::numeric_limits<double>::quiet_NaN();
    if (device.fault == "jump" && device.reads % 2 == 0) poses[i].position_m[0] += 0.3;
  }
  return KIROKU_HAPTIC_DONE;
}

int write_forces(void* opened, const KirokuHapticForce* forces) {
  static_cast<Device*>(opened)->first = forces[0];
  return KIROKU_HAPTIC_DONE;
}

int read_hand(void* opened, KirokuHapticPose* poses, KirokuHapticPose* wrist) {
  auto& device = *static_cast<Device*>(opened);
  const int answer = read_poses(opened, poses);
  *wrist = {{0, -0.2, -0.05}, {1, 0, 0, 0}};
  if (device.reads > 100 && device.fault == "nan wrist") wrist->orientation[2] = std::nan("");
  if (device.reads > 100 && device.fault == "jump wrist" && device.reads % 2 == 0)
    wrist->position_m[0] += 0.3;
  if (device.fault == "echo") {
    std::memcpy(poses[0].position_m, device.wrist.n, sizeof device.wrist.n);
    std::memcpy(poses[1].position_m, device.wrist.nm, sizeof device.wrist.nm);
    std::memcpy(wrist->position_m, device.first.n, sizeof device.first.n);
  }
  return answer;
}

int write_hand(void* opened, const KirokuHapticForce* forces, const KirokuHapticWristForce* wrist) {
  static_cast<Device*>(opened)->wrist = *wrist;
  return write_forces(opened, forces);
}
void close_device(void* opened) { delete static_cast<Device*>(opened); }

}  // namespace

#ifdef KIROKU_TEST_WRIST
extern "C" const KirokuHapticPlugin2* kiroku_haptic_plugin_2(void) {
  static const KirokuHapticPlugin2 kPlugin{KIROKU_TEST_ABI, 0, open_device, read_hand,
#ifdef KIROKU_TEST_NO_WRITE
                                           nullptr,
#else
                                           write_hand,
#endif
                                           close_device};
  return &kPlugin;
}
#endif

#if defined(KIROKU_TEST_BOTH) || (!defined(KIROKU_TEST_WRIST) && !defined(KIROKU_TEST_NO_SYMBOL))
extern "C" const KirokuHapticPlugin* kiroku_haptic_plugin(void) {
#ifdef KIROKU_TEST_BOTH
  static_assert(KIROKU_TEST_ABI == KIROKU_HAPTIC_ABI_2);
  constexpr std::uint32_t kAbi = KIROKU_HAPTIC_ABI;
#else
  constexpr std::uint32_t kAbi = KIROKU_TEST_ABI;
#endif
  static const KirokuHapticPlugin kPlugin{kAbi, 0, open_device, read_poses, write_forces, close_device};
  return &kPlugin;
}
#endif

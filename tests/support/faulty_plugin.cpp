// Haptic plug-ins that fail, for tests: built without what is exported (KIROKU_TEST_NO_SYMBOL), for another
// ABI (KIROKU_TEST_ABI), or as the argument says after a hundred poses: "nan", "jump", "throw", "lose".
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>

#include "sim/haptics/haptic_plugin.h"

#ifndef KIROKU_TEST_ABI
#define KIROKU_TEST_ABI KIROKU_HAPTIC_ABI
#endif

namespace {

struct Device {
  std::string fault;
  std::uint32_t fingers;
  int reads = 0;
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

int write_forces(void* /*opened*/, const KirokuHapticForce* /*forces*/) { return KIROKU_HAPTIC_DONE; }
void close_device(void* opened) { delete static_cast<Device*>(opened); }

}  // namespace

#ifndef KIROKU_TEST_NO_SYMBOL
extern "C" const KirokuHapticPlugin* kiroku_haptic_plugin(void) {
  static const KirokuHapticPlugin kPlugin{KIROKU_TEST_ABI, 0,           open_device, read_poses,
                                          write_forces,    close_device};
  return &kPlugin;
}
#endif

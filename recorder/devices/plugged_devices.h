// What is plugged into this machine, as the kernel and udev tell it in files: nothing is opened. Functions;
// thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace kiroku::recorder {

/// Where they are told: the machine's own, unless a test gives others.
struct DeviceFolders {
  std::filesystem::path sys = "/sys", proc = "/proc", dev = "/dev";
};

/// A V4L2 device node. A camera may have several; only some of them give pictures (camera_query.h).
struct CameraNode {
  std::string node;     // "/dev/video0": another one after cables were changed
  std::string lasting;  // a link of udev that stays this camera's; "" where there is none
  std::string name;     // of the device, as its driver says: "HD Pro Webcam C920"
};
/// /sys/class/video4linux (Linux, Documentation/userspace-api/media/v4l), in the order of their numbers. Of
/// the links, that by the device's identity (/dev/v4l/by-id) is taken where it tells it from every other
/// one, else that of the plug (/dev/v4l/by-path): of two devices without serial numbers, udev gives the
/// former to either.
std::vector<CameraNode> camera_nodes(const DeviceFolders& folders = {});

/// What ALSA takes sound in by.
struct SoundInput {
  std::string node;    // "/dev/snd/pcmC1D0c"
  std::string device;  // for ALSA's programs: "hw:CARD=C920,DEV=0"
  std::string name;    // "HD Pro Webcam C920: USB Audio"
};
/// /proc/asound/cards and /proc/asound/pcm (Linux, Documentation/sound/designs/procfile.rst).
std::vector<SoundInput> sound_inputs(const DeviceFolders& folders = {});

struct SerialPort {
  std::string node;     // "/dev/ttyUSB0"
  std::string lasting;  // below /dev/serial/by-id; "" where there is none
  std::string name;     // of a USB device: "FTDI FT232R USB UART"; else of its driver
};
/// /sys/class/tty, without terminals and without ports that have no hardware behind them (`type` 0).
std::vector<SerialPort> serial_ports(const DeviceFolders& folders = {});

/// The group whose members may open a device that this user may not; nothing where that is not what lacks.
std::optional<std::string> missing_group(const std::filesystem::path& device);

}  // namespace kiroku::recorder

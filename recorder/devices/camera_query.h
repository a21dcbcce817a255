// What a V4L2 device says that it can give (Linux, Documentation/userspace-api/media/v4l): asked by its own
// calls, without taking a picture, so that a device in use answers too. Functions; thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace kiroku::recorder {

/// Pictures a second, as a fraction; 0/1: the device does not say.
struct CameraRate {
  std::uint32_t pictures = 0, seconds = 1;
  [[nodiscard]] double value() const { return double(pictures) / double(seconds); }
  /// As the option `rate` takes it: "30", "30000/1001".
  [[nodiscard]] std::string to_string() const;
  friend bool operator==(const CameraRate&, const CameraRate&) = default;
};

struct CameraMode {
  std::string format;     // as the option `format` takes it ("yuyv422", "mjpeg"); else the four characters
  bool readable = false;  // whether the recorder knows the format
  std::uint32_t width = 0, height = 0;
  CameraRate rate;  // the greatest
  friend bool operator==(const CameraMode&, const CameraMode&) = default;
};

struct CameraAbility {
  std::string driver, card, bus;  // "uvcvideo", "HD Pro Webcam C920", "usb-0000:00:14.0-1"
  /// Whether this node gives pictures; one for metadata or for showing pictures does not.
  bool captures = false;
  std::vector<CameraMode> modes;  // in the device's order
};

/// Throws kiroku::IoError where the node cannot be opened, kiroku::Error where no V4L2 device is behind it.
/// Waits as long as the driver does.
CameraAbility ask_camera(const std::string& node);

/// The name of a four-character code for the option `format`; "" for one that the recorder does not read.
std::string camera_format_name(std::uint32_t code);

/// What to ask for: of the modes that can be read and give 24 pictures a second or more (where none does: of
/// all), the largest, then the fastest up to 60 a second, then the one that is compressed least. Nothing
/// where none can be read.
std::optional<CameraMode> best_mode(const std::vector<CameraMode>& modes);

/// "?size=1920x1080&rate=30&format=mjpeg": what follows the device in a source's address.
std::string options_of(const CameraMode& mode);

}  // namespace kiroku::recorder

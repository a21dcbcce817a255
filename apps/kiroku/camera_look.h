// Looking at one camera: what it can give, what to put into kiroku.toml, and a still. What is asked of a
// driver is asked on a thread of its own and waited for a bounded time. Functions; thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "recorder/devices/camera_query.h"
#include "recorder/devices/plugged_devices.h"

namespace kiroku::apps {

struct CameraLook {
  recorder::CameraNode node;
  std::optional<recorder::CameraAbility> ability;  // nothing where it could not be asked
  /// Why, and what to do: sentences without end; "" where it could.
  std::string problem, advice;
  /// A source's address that asks for the best that it gives; "" where nothing of it can be recorded.
  std::string source;
  [[nodiscard]] bool gives_pictures() const { return ability && ability->captures; }
};
CameraLook look_at_camera(const recorder::CameraNode& node);

struct Still {
  std::filesystem::path file;
  std::string input;   // what came: "1920x1080 yuyv422, 30 a second"
  std::string remark;  // that it gives other pictures than were asked for; "" where it does not
};
/// A picture of what the camera sees now, some pictures after it was opened, since cameras adjust to the
/// light first. A PNG file, readable by its owner alone. Throws kiroku::Error: it gives none, another program
/// has it, the file is there and may not be replaced.
Still take_still(const std::string& source, const std::filesystem::path& file, bool overwrite);

}  // namespace kiroku::apps

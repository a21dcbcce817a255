// What the server asks of the recorder that runs in its own process.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "media/pointing_line.h"

namespace kiroku::viewer {

struct LiveRooms {
  /// The case that is being recorded in the room; "": none. Called often, from several threads; null where
  /// this process records nothing.
  std::function<std::string(const std::string& room)> running_case;
  /// What its clock shows now, in nanoseconds; nothing where none runs. May be null as well.
  std::function<std::optional<std::int64_t>(const std::string& room)> now_ns = {};
  /// Puts into that case where somebody points, and returns when that was on its clock; nothing where none
  /// runs, or another one than `meant` ("": whichever). Never waits for a disk.
  std::function<std::optional<std::int64_t>(const std::string& room, media::PointedAt at,
                                            const std::string& meant)>
      point;
};

}  // namespace kiroku::viewer

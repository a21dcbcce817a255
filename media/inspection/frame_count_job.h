// What inspector.h has done in a box (box/job_box.h): apart, so that who asks for it loads no codecs.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "media/box/job_box.h"

namespace kiroku::media {

/// In the box: {"media", "name", "complete"} of segment 0, of which {"frames"} are counted.
inline constexpr const char* kCountFrames = "frames";
nlohmann::json count_frames(const nlohmann::json& with, JobSegments& segments);

}  // namespace kiroku::media

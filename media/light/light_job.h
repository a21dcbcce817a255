// What light_reading.h has done in a box (box/job_box.h): apart, so that who asks for it loads no codecs.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "media/box/job_box.h"

namespace kiroku::media {

/// In the box: {"media", "name", "complete", "places"} of segment 0. Gives a line for each picture, as
/// box_answers.h says; the answer has "places", as they are known at the end.
inline constexpr const char* kReadLight = "light";
nlohmann::json read_light_in_box(const nlohmann::json& with, JobSegments& segments);

}  // namespace kiroku::media

// What inspector.h has done in a box (box/job_box.h): apart, so that who asks for it loads no codecs.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "media/box/job_box.h"

namespace kiroku::media {

/// In the box: {"media", "name", "complete"} of segment 0, which must be one film and nothing beside it
/// (container_form.h). Of its pictures {"frames"} are counted. {"first", "last"} are the time stamps of the
/// first and the last one, in the unit of such media (archive::unit_of_media); not there without a picture.
/// {"turned"}: the number of the first picture that has no time stamp, or none behind that of the one before
/// it; not there where all have.
inline constexpr const char* kCountFrames = "frames";
nlohmann::json count_frames(const nlohmann::json& with, JobSegments& segments);

}  // namespace kiroku::media

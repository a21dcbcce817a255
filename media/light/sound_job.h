// What sound_reading.h has done in a box (box/job_box.h): apart, so that who asks for it loads no codecs.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "media/box/job_box.h"

namespace kiroku::media {

/// Windows of one job at most: a minute of sound.
inline constexpr int kMostSoundWindows = 12;

/// In the box: {"windows", "phases", "segments": [{"media", "name", "complete", "from", "earliest",
/// "latest"}]}, segments by their numbers, "from" the time stamp at which the first window begins. Sound that
/// is stamped before "earliest" or after "latest", since then, is damage of its segment. Windows follow one
/// another, each as long as a period of codes. For each window whose codes are wholly recorded, and each
/// other one in which a code is clearly heard, it gives a line without sightings, then one for each thing
/// that may be a code, as box_answers.h says, with stamps since the first window began. The answer has
/// "phases", as they are known at the end; "rates", of samples, of every segment, 0: without sound; and
/// "damaged", by segment.
inline constexpr const char* kReadSound = "light-sound";
nlohmann::json read_sound_in_box(const nlohmann::json& with, JobSegments& segments);

}  // namespace kiroku::media

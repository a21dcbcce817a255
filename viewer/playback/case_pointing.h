// Where people pointed on a case's live pictures, as its stream `pointing` has it. Functions; thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "media/pointing_line.h"
#include "viewer/playback/case_media.h"

namespace kiroku::playback {

/// One person pointing on one stream without a pause of a second and a half.
struct PointingStroke {
  std::int64_t start_ns = 0, end_ns = 0;
  std::string by, role, stream;
  std::uint64_t points = 0;
};

/// What was pointed at in [from_ns, to_ns), in order of time. Throws as CaseMedia::open, and kiroku::Error
/// for a line that is none.
std::vector<media::PointingLine> pointing_of(const CaseMedia& media, std::int64_t from_ns,
                                             std::int64_t to_ns);
/// All of it in short, in order of their starts.
std::vector<PointingStroke> pointing_strokes(const CaseMedia& media);

}  // namespace kiroku::playback

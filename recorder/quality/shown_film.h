// What a coding leaves of a clip, as a film that browsers play without taking anything more from it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "recorder/quality/clip.h"
#include "recorder/quality/coding.h"

namespace kiroku::recorder {

struct ShownFilm {
  std::uint64_t pictures = 0;
  double seconds = 0;
  int width = 0, height = 0;
  std::string pictures_are;  // of the clip, for people: "1280x720 yuv420p"
  int depth = 8;             // bits of the clip's samples; the film has 8
};

/// Called with the number of pictures done. Throwing ends the work.
using ShownProgress = std::function<void(std::uint64_t done)>;

/// Codes the clip, decodes it, and writes what came back to `file` as lossless H.264 (x264, quantiser 0) in
/// MP4, with the clip's own subsampling, range and colours, whatever the coding. Chromium and Firefox of
/// Debian play it with 4:2:0, 4:2:2 and 4:4:4. The film is decoded again as it is made and every sample
/// compared with what it was made of; samples of 10 bits are brought to 8 before, since a page shows no more.
/// Nothing in it tells of the coding but its pictures, and how many bytes they take. Throws kiroku::Error
/// where it is not the same, and as Clip and RoundTrip do; kiroku::UsageError for a clip that is shorter than
/// kShortestClipSeconds, or whose sides H.264 cannot hold.
ShownFilm write_shown_film(const std::filesystem::path& clip, ClipStretch stretch, const Coding& coding,
                           const std::filesystem::path& file, const ShownProgress& progress);

/// Lengthens an MP4 file to `size` bytes with a box that players pass over (ISO/IEC 14496-12, "free") and
/// that holds random bytes. kiroku::UsageError where that is less than eight bytes more than it has;
/// kiroku::IoError.
void pad_film(const std::filesystem::path& file, std::uint64_t size);
/// What a box takes at least.
inline constexpr std::uint64_t kLeastPadding = 8;

}  // namespace kiroku::recorder

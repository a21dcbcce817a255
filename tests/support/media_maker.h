// Small films for tests, the same bytes each time: a moving pattern with some detail. Functions; thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/bytes.h"

namespace kiroku::test {

struct FilmOptions {
  int width = 96, height = 64;
  int frames_per_segment = 25;
  int segments = 3;
  int rate = 25;
  /// Pictures left out between segments: the time stamps jump.
  int gap_frames = 0;
  bool sound = false;  // MPEG audio beside the pictures (MPEG-TS only)
};

/// MPEG-2 in MPEG-TS: one muxer time line, each segment begins with tables and a key frame.
std::vector<Bytes> make_transport_stream(const FilmOptions& options);
/// One Matroska file a segment, time stamps going on. `codec`: "ffv1" or "rawvideo".
std::vector<Bytes> make_matroska(const FilmOptions& options, const std::string& codec);

/// A JPEG picture, as cameras send them one after the other.
Bytes make_jpeg(int width, int height);

/// A film of ten JPEG pictures of 64x32 in QuickTime with such a matrix in its track's header, as telephones
/// write it. `orientations`: of EXIF (1 to 8), which a picture says itself; 0, or beyond the last: it says
/// none.
void write_film_with_matrix(const std::filesystem::path& file, const std::array<std::int32_t, 9>& matrix,
                            const std::vector<int>& orientations = {});

/// A decoded picture: what must not change in an export.
struct Picture {
  std::int64_t time_ms = 0;  // from the first picture
  std::string digest;        // SHA-256 of its samples
  bool operator==(const Picture&) const = default;
};
/// Decodes a file found out by probing, as any player would.
std::vector<Picture> decode_file(const std::string& path);

}  // namespace kiroku::test

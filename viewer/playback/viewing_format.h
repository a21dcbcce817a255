// What the pictures of a stream's viewing copy look like: one form for the whole stream, so that one
// initialisation segment goes with all of its pieces. A value.
#pragma once

namespace kiroku::playback {

struct ViewingFormat {
  /// Of the picture in the copy; even. Archived pictures of another shape stand in it as large as they can,
  /// with black beside them.
  int width = 0, height = 0;
  /// Shape of a pixel, width : height.
  int aspect_numerator = 1, aspect_denominator = 1;
  /// ISO 23091-2 code points, as of libavutil.
  int primaries = 2, transfer = 2, matrix = 2;
  /// Archived pictures a second, about: what a decoder must be able to keep up with.
  int rate = 25;
  bool operator==(const ViewingFormat&) const = default;
};

}  // namespace kiroku::playback

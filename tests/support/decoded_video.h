// What a decoder makes of a film in memory.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/bytes.h"

namespace kiroku::test {

struct DecodedFrame {
  std::int64_t pts = 0;  // in the container's units
  bool key = false;
  int width = 0, height = 0;
  std::string pixel_format;
  double brightness = 0;  // mean of the first plane's bytes
  std::string sha256;     // of the picture's bytes
};

struct DecodedVideo {
  std::vector<DecodedFrame> frames;
  std::int64_t sound_samples = 0;       // of the first sound stream, 0 if there is none
  std::string sound_codec;              // "" if there is none
  std::vector<std::string> complaints;  // libav's warnings and errors while reading and decoding
};

/// Reads `film` as libavformat finds it and decodes pictures and sound until there are `at_most` pictures.
/// Not thread-safe: it listens to libav's log meanwhile.
DecodedVideo decode_video(ByteView film, std::size_t at_most = SIZE_MAX);

}  // namespace kiroku::test

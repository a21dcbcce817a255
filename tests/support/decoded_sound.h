// What a decoder makes of the sound of a film in memory.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/bytes.h"

namespace kiroku::test {

struct DecodedSound {
  int rate = 0, channels = 0;
  std::string codec;
  /// Time stamp of the first block, in samples.
  std::int64_t start = 0;
  /// Of the first channel, from -1 to 1, block after block as the decoder gives them.
  std::vector<double> samples;
  /// Where a block does not begin where the one before ended, by its time stamp to within `tolerance`: in
  /// samples from the first.
  std::vector<std::int64_t> breaks;

  [[nodiscard]] double at(std::int64_t sample) const {
    return samples.at(static_cast<std::size_t>(sample - start));
  }
  [[nodiscard]] std::int64_t end() const { return start + static_cast<std::int64_t>(samples.size()); }
};

/// `tolerance` in samples: what a container rounds time stamps by.
DecodedSound decode_sound(ByteView film, std::int64_t tolerance = 0);

/// Where, after at least 10 ms that are quieter, something louder than a fifth of the loudest begins.
std::vector<std::int64_t> beeps_of(const DecodedSound& sound);

}  // namespace kiroku::test

// A short film with a tone beside its pictures, as a file that a recorder records from.
#pragma once

#include <filesystem>

namespace kiroku::test {

inline constexpr double kToneHz = 440;

/// Two seconds of 20 pictures each in Matroska (FFV1, FLAC); the tone, one channel, has a quarter of the
/// largest amplitude and begins with the first picture.
std::filesystem::path make_film_with_sound(const std::filesystem::path& file, int sample_rate = 44'100);

}  // namespace kiroku::test

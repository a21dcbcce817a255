// A film that is hard to code: fine texture over coarse, which moves. The same bytes each time. H.264, 4:2:0.
#pragma once

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <random>
#include <vector>

#include "media/film_writer.h"

namespace kiroku::test {

inline void write_textured_film(const std::filesystem::path& file, int width, int height, int pictures) {
  constexpr int kSide = 64;  // of the texture, which repeats
  std::mt19937 random(11);
  std::uniform_int_distribution<int> grain(-30, 30);
  std::vector<int> texture(kSide * kSide);
  for (int& one : texture) one = grain(random);
  media::FilmWriter film(file, {width, height, 3, 25, 1});
  for (int n = 0; n < pictures; ++n) {
    std::vector<std::uint8_t> samples;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const auto at = static_cast<std::size_t>((y + n) % kSide * kSide + (x + 3 * n) % kSide);
        const int coarse = static_cast<int>(30 * std::sin(0.05 * (x + 2 * n)) * std::cos(0.07 * y));
        for (const int base : {170, 95, 85})
          samples.push_back(static_cast<std::uint8_t>(base + coarse + texture[at]));
      }
    }
    film.add({width, height, 3, samples});
  }
  film.finish();
}

}  // namespace kiroku::test

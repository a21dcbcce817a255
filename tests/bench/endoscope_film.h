// Rendered pictures as an endoscope's film has them, for benches whose truth is known. Fixed seeds: the same
// everywhere.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "media/film_writer.h"
#include "sim/render/picture.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::bench {

/// What a seed makes of a sequence.
class Chance {
 public:
  explicit Chance(std::uint32_t seed) : random_(seed) {}
  double between(double low, double high) {
    return low + (high - low) * double(random_()) / double(std::mt19937::max());
  }
  int one_of(int count) { return std::min(count - 1, static_cast<int>(between(0, count))); }

 private:
  std::mt19937 random_;
};

/// The pictures after MPEG-2 at 4 Mbit/s.
inline std::vector<sim::Picture> through_mpeg2(const std::vector<sim::Picture>& pictures) {
  const test::TemporaryFolder folder;
  const std::filesystem::path lossless = folder / "lossless.mkv", coded = folder / "coded.mpg";
  media::FilmWriter writer(lossless, {pictures[0].width, pictures[0].height, 3, 25, 1});
  for (const sim::Picture& picture : pictures) writer.add({picture.width, picture.height, 3, picture.rgb});
  writer.finish();
  const std::string quiet = "ffmpeg -nostdin -v error -y -i ";
  const std::string encode = quiet + lossless.string() +
                             " -c:v mpeg2video -pix_fmt yuv420p -b:v 4M -maxrate 4M -bufsize 2M -g 12 " +
                             coded.string();
  if (std::system(encode.c_str()) != 0) throw Error("ffmpeg did not encode: is it installed?");
  const std::string decode = quiet + coded.string() + " -f rawvideo -pix_fmt rgb24 -";
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(popen(decode.c_str(), "r"), pclose);
  std::vector<sim::Picture> decoded;
  while (pipe && decoded.size() < pictures.size()) {
    sim::Picture picture(pictures[0].width, pictures[0].height);
    if (std::fread(picture.rgb.data(), 1, picture.rgb.size(), pipe.get()) != picture.rgb.size()) break;
    decoded.push_back(std::move(picture));
  }
  if (decoded.size() != pictures.size()) throw Error("ffmpeg gave other pictures back than it got");
  return decoded;
}

/// What a bench of sequences is asked for.
struct SequenceSettings {
  std::uint32_t first = 1;  // seed of the first one
  int sequences = 8, pictures = 30;
  std::string clip, records, show;
  std::vector<std::string> told;  // files of records to tell of, and nothing is made
  bool lenses = false;

  /// "--first N --sequences N --pictures N --clip FILE --records FILE --show FOLDER --tell FILE
  /// --lenses yes", in any order.
  void read(int argc, const char* const* argv) {
    for (int i = 1; i + 1 < argc; i += 2) {
      const std::string name = argv[i], value = argv[i + 1];
      if (name == "--first") first = static_cast<std::uint32_t>(std::stoul(value));
      if (name == "--sequences") sequences = std::stoi(value);
      if (name == "--pictures") pictures = std::stoi(value);
      if (name == "--clip") clip = value;
      if (name == "--records") records = value;
      if (name == "--show") show = value;
      if (name == "--tell") told.push_back(value);
      if (name == "--lenses") lenses = value == "yes";
    }
  }
};

}  // namespace kiroku::bench

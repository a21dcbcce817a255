// Pictures in which a display's code may stand: whoever made a case chose them. Finding and reading stay
// within the picture, end, and give places and words of the form that others count on. The first two bytes
// are the picture's width and height, the third says how many bytes of a row behind its end are not the
// picture's.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "light/light_code.h"
#include "light/picture_finder.h"

namespace {

using namespace kiroku::light;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 4) return 0;
  const int width = data[0] + 1, height = data[1] + 1, stride = width + data[2] % 16;
  // A copy of exactly the picture's size, so that a byte beside it is noticed.
  std::vector<std::uint8_t> samples(static_cast<std::size_t>(stride) * static_cast<std::size_t>(height - 1) +
                                    static_cast<std::size_t>(width));
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = data[3 + i % (size - 3)];
  const GreyView picture{samples.data(), width, height, stride};
  PictureFinder finder;
  for (int pass = 0; pass < 2; ++pass) {
    finder.search(picture);
    require(finder.places().size() <= PictureFinder::kMostPlaces);
    for (const Place& place : finder.places())
      for (const Point& corner : place) require(std::isfinite(corner.x) && std::isfinite(corner.y));
    for (const Sighting& sighting : finder.read(picture)) {
      require(sighting.place < finder.places().size());
      require(sighting.opposite >= 0 && sighting.opposite <= kCodeBits);
      for (const std::uint64_t word : sighting.words) require((word & ~kCodeMask) == 0);
    }
  }
  return 0;
}

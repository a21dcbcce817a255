// Sound in which a display's code may be: whoever made a case chose its samples. Finding and reading stay
// within the stretch, end, and give numbers of the form that others count on. The first byte says how often
// each sample stands there, so that a few bytes are sound as long as a code; the second, what the stretch's
// first sample is called, and whether it is shorter than a code.
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "light/light_code.h"
#include "light/sound_finder.h"

namespace {

using namespace kiroku::light;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 4) return 0;
  // A code and a few steps more: a longer stretch is the same once more.
  constexpr std::size_t kMost = SoundFinder::kCodeSamples + SoundFinder::kSlotSamples;
  const std::size_t length = data[1] % 8 == 0 ? SoundFinder::kCodeSamples - 1 : kMost;
  const std::size_t each = data[0] + std::size_t{1};
  const std::int64_t first = (data[1] - 128) * std::int64_t{1'000'000'007};
  std::vector<std::int16_t> samples(length);
  const std::size_t given = (size - 2) / 2;
  for (std::size_t i = 0; i < length; ++i)
    std::memcpy(&samples[i], data + 2 + 2 * (i / each % given), sizeof samples[i]);
  static SoundFinder finder;  // its tables cost more than a stretch; what it remembers is bounded
  const auto heard = finder.read({first, samples}, SoundFinder::kSlotSamples);
  require(heard.size() <= SoundFinder::kMostHeard);
  for (const HeardCode& code : heard) {
    require(code.sample >= first && code.sample < first + SoundFinder::kSlotSamples);
    require(code.sighting.opposite >= 0 && code.sighting.opposite <= kCodeBits);
    require(code.sighting.clarity >= 0 && code.sighting.clarity <= 1);
    for (const std::uint64_t word : code.sighting.words) require((word & ~kCodeMask) == 0);
  }
  require(finder.phases().size() <= SoundFinder::kMostPhases);
  for (const int phase : finder.phases()) require(phase >= 0 && phase < SoundFinder::kPeriodSamples);
  return 0;
}

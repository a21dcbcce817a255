#include "recorder/sound_gaps.h"

#include <algorithm>

namespace kiroku::recorder {
namespace {

// Sound may come so long after the pictures of its time.
constexpr std::int64_t kLatestNs = 2'000'000'000;

}  // namespace

bool SoundGaps::is_hole_before(std::int64_t start_ns) const {
  return start_ns - until_ns_ > (begun_ ? kSmallestNs : kAtEndsNs);
}

bool SoundGaps::leaves_out(std::int64_t start_ns) {
  return is_hole_before(start_ns) && pace_.refused_until(start_ns);
}

std::optional<Gap> SoundGaps::heard(std::int64_t start_ns, std::int64_t end_ns) {
  std::optional<Gap> gap;
  if (is_hole_before(start_ns)) gap = Gap{{until_ns_, start_ns}, cause_};
  begun_ = true;
  until_ns_ = std::max(until_ns_, end_ns);
  cause_ = archive::GapCause::kSignalLost;
  return gap;
}

std::optional<Gap> SoundGaps::piece_before(std::int64_t time_ns) {
  if (time_ns - kLatestNs - until_ns_ < kPieceNs) return {};
  const Gap piece{{until_ns_, until_ns_ + kPieceNs}, cause_};
  begun_ = true;
  until_ns_ += kPieceNs;
  return piece;
}

std::optional<Gap> SoundGaps::gap_at_close(std::int64_t close_ns) const {
  if (close_ns - until_ns_ <= kAtEndsNs) return {};
  return Gap{{until_ns_, close_ns}, cause_};
}

}  // namespace kiroku::recorder

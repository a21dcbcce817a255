#include "viewer/playback/picture_span.h"

#include <utility>

namespace kiroku::playback {

PictureSpan::PictureSpan(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                         const std::string& stream, std::int64_t from_ns, std::int64_t to_ns)
    : media_(recording, identities),
      reader_(media_, media_.video(stream)),
      ended_(recording.segments(stream, from_ns, to_ns).empty()) {
  if (from_ns > 0) from_ = ticks_of_ns(from_ns);
  if (to_ns < INT64_MAX) reader_.stop_before(ticks_of_ns(to_ns) + 1);  // it may have been rounded down
}

bool PictureSpan::next() {
  if (ended_) return false;
  if (const auto from = std::exchange(from_, std::nullopt)) static_cast<void>(reader_.seek(*from));
  picture_ = reader_.next();
  ended_ = !picture_;
  return !ended_;
}

}  // namespace kiroku::playback

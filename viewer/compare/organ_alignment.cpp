#include "viewer/compare/organ_alignment.h"

#include <algorithm>
#include <optional>

extern "C" {
#include <libavutil/frame.h>
}

#include "base/error.h"
#include "media/rgb_converter.h"
#include "viewer/playback/picture_span.h"

namespace kiroku::compare {

std::size_t Alignment::held() const {
  return static_cast<std::size_t>(std::ranges::count_if(moments, &sim::AlignedMoment::held));
}

const sim::AlignedMoment* Alignment::at(std::int64_t case_ns) const {
  const auto after = std::ranges::upper_bound(moments, case_ns, {}, &sim::AlignedMoment::time_ns);
  if (after == moments.begin()) return nullptr;
  const sim::AlignedMoment& last = *std::prev(after);
  return case_ns - last.time_ns <= kAlignedMostNs ? &last : nullptr;
}

std::vector<Alignment::Lost> Alignment::lost() const {
  std::vector<Lost> all;
  const sim::AlignedMoment* before = nullptr;
  for (const sim::AlignedMoment& moment : moments) {
    if (before != nullptr && !before->held()) all.back().span.end_ns = moment.time_ns;
    if (!moment.held() && (before == nullptr || before->why != moment.why))
      all.push_back({{moment.time_ns, moment.time_ns}, moment.why});
    before = &moment;
  }
  if (before != nullptr && !before->held()) all.back().span.end_ns = std::max(span.end_ns, before->time_ns);
  return all;
}

std::string sentence_of(sim::WhyLost why) {
  switch (why) {
    case sim::WhyLost::kNotLost:
      return "it was found";
    case sim::WhyLost::kNoOrgan:
      return "nothing in the picture has the organ's outline";
    case sim::WhyLost::kAlike:
      return "two places of the organ explain its outline alike";
    case sim::WhyLost::kMirrored:
      return "the organ's mirror image explains the outline as well or better";
    case sim::WhyLost::kHidden:
      return "too little of the organ is seen";
    case sim::WhyLost::kUncertain:
      return "what is seen leaves its place open by more than 6 mm";
    case sim::WhyLost::kContradictory:
      return "its outline and its texture say different things";
    case sim::WhyLost::kNotLooked:
      return "it was not found before, and not searched for here";
  }
  return "nothing is known";
}

Alignment align_organ(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                      const std::string& stream, const sim::TetMesh& mesh, const AlignmentRequest& request,
                      const std::function<void(double share)>& share) {
  if (request.span.end_ns - request.span.start_ns > kLongestAlignedNs) {
    throw UsageError(
        "the plan is aligned with an hour of a recording at most: say which with --from and --to");
  }
  sim::OrganTrack track(mesh, request.field_deg, request.range);
  playback::PictureSpan frames(recording, identities, stream, request.span.start_ns, request.span.end_ns);
  media::RgbConverter converter;
  Alignment alignment{request.span, request.field_deg, {}};
  const double all_ns = double(std::max<std::int64_t>(1, request.span.end_ns - request.span.start_ns));
  while (frames.next() && frames.time_ns() < request.span.end_ns) {
    const std::int64_t time_ns = frames.time_ns();
    if (time_ns < request.span.start_ns) continue;
    // A tenth of a second is short enough to follow an endoscope, and keeps the work within bounds.
    constexpr std::int64_t kJitterNs = 5'000'000;
    if (!alignment.moments.empty() &&
        time_ns < alignment.moments.back().time_ns + kAlignedEveryNs - kJitterNs)
      continue;
    sim::Picture picture;
    picture.width = frames.frame().width;
    picture.height = frames.frame().height;
    picture.rgb = converter.convert(frames.frame());
    alignment.moments.push_back(track.take(time_ns, picture));
    if (share) share(double(time_ns - request.span.start_ns) / all_ns);
  }
  if (alignment.moments.empty())
    throw UsageError("stream '" + stream + "' holds no picture in that stretch, so nothing can be aligned");
  return alignment;
}

}  // namespace kiroku::compare

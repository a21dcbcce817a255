#include "archive/verify/segment_times.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/format/segment_media.h"
#include "base/printable.h"

namespace kiroku::archive {
namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
/// Of pictures one after the other none has the time stamp of the one before it. Nobody records as many.
constexpr std::uint64_t kMostPictures = std::uint64_t{1} << 32;
/// Both numbers of a difference are rounded, and those of two differences are compared.
constexpr std::int64_t kRounded = 2;

std::int64_t units_of(std::int64_t ns, std::int64_t per_second) {
  return ns / kNsPerSecond * per_second + (ns % kNsPerSecond * per_second + kNsPerSecond / 2) / kNsPerSecond;
}

std::string seconds_text(std::int64_t units, std::int64_t per_second) {
  constexpr std::int64_t kMs = 1'000;
  const std::int64_t size = std::abs(units);
  const std::string fraction = std::to_string(kMs + size % per_second * kMs / per_second);
  return (units < 0 ? "-" : "") + std::to_string(size / per_second) + "." + fraction.substr(1) + " s";
}

std::int64_t pictures_of(const SegmentEntry& segment) {
  return static_cast<std::int64_t>(std::min(segment.frames, kMostPictures));
}

}  // namespace

SegmentTimes::SegmentTimes(StreamInfo info, FindingList& findings)
    : info_(std::move(info)), findings_(&findings) {}

void SegmentTimes::take(const SegmentEntry& segment, std::uint64_t entry, bool interrupted) {
  if (!segment.counted) return;  // states no time stamp
  const std::string media = media_of(info_, segment);
  const MediaUnit unit = unit_of_media(media);
  if (segment.time_base != unit.time_base) {
    differ(segment, entry,
           "in units of " + in_quotation_marks(segment.time_base) + " s, where such media have " +
               std::string(unit.time_base));
    return;
  }
  if (media == kLinesMedia) {
    if (segment.first_pts != segment.span.start_ns)
      differ(segment, entry,
             "from " + std::to_string(segment.first_pts) + " ns on, where its lines begin at " +
                 std::to_string(segment.span.start_ns) + " ns");
    return;
  }
  compare(containers_[media], unit.per_second, segment, entry, interrupted);
}

// Every recorder stamps a picture at its time plus the container's constant, or later where pictures came in
// a burst, and never before one that came earlier.
void SegmentTimes::compare(Container& of, std::int64_t per_second, const SegmentEntry& segment,
                           std::uint64_t entry, bool interrupted) {
  const std::int64_t start = units_of(segment.span.start_ns, per_second);
  const Stated stated{segment.first_pts - start, entry};
  const std::int64_t spread = units_of(kLatestStampNs, per_second);
  std::int64_t latest = start + spread;
  if (of.is_begun && !interrupted) {
    if (segment.first_pts - of.first_pts < -spread) {
      differ(segment, entry,
             "from " + seconds_text(segment.first_pts, per_second) +
                 " on, where the segment before it begins at " + seconds_text(of.first_pts, per_second) +
                 ", and by their times it comes " + seconds_text(start - of.start, per_second) + " later");
    }
  }
  if (of.is_begun) latest = std::max(latest, of.latest + of.pictures);
  const Stated floor{stated.offset - (latest - start), entry};
  if (!of.is_begun || stated.offset < of.lowest.offset) of.lowest = stated;
  if (!of.is_begun || floor.offset > of.floor.offset) of.floor = floor;
  if (of.floor.offset > of.lowest.offset + kRounded) tell_late(of.lowest, of.floor, per_second);
  of.is_begun = true;
  of.latest = latest;
  of.first_pts = segment.first_pts;
  of.start = start;
  of.pictures = pictures_of(segment);
}

void SegmentTimes::differ(const SegmentEntry& segment, std::uint64_t entry, const std::string& how) {
  if (std::exchange(told_differ_, true)) return;
  findings_->add("segment-times-differ", {segment.file.file, entry},
                 "entry " + std::to_string(entry) + " states that segment " + std::to_string(segment.index) +
                     " of " + info_.name + " is stamped " + how + ": no recorder stamps so");
}

void SegmentTimes::tell_late(const Stated& early, const Stated& late, std::int64_t per_second) {
  if (std::exchange(told_late_, true)) return;
  findings_->add("segment-times-late", {std::string(kLedgerFile), late.entry},
                 "by the stamps that entries " + std::to_string(std::min(early.entry, late.entry)) + " and " +
                     std::to_string(std::max(early.entry, late.entry)) + " state, pictures of " + info_.name +
                     " are further apart, or less, than by their times: by more than " +
                     seconds_text(late.offset - early.offset, per_second) + " beyond what a burst explains");
}

}  // namespace kiroku::archive

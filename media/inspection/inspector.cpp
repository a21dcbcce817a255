#include "media/inspection/inspector.h"

#include <algorithm>
#include <chrono>

#include <nlohmann/json.hpp>

#include "archive/format/segment_media.h"
#include "archive/verify/segment_times.h"
#include "archive/verify/stream_rules.h"
#include "base/error.h"
#include "crypto/hashed_source.h"
#include "media/borrowed_source.h"
#include "media/box/boxed_jobs.h"
#include "media/inspection/frame_count_job.h"
#include "media/plaintext_lines.h"
#include "media/sealed_segment.h"
#include "media/segment_input.h"
#include "media/stream_clock.h"
#include "media/vital_line.h"

namespace kiroku::media {
namespace {

using archive::InspectionProblem;

/// Of one segment. The box takes ten minutes of a processor at most.
constexpr std::chrono::hours kLongestCounting{1};
/// What a decoder says is held within this, so that no sum overflows: counts and time stamps are far below.
constexpr std::int64_t kFurthest = std::int64_t{1} << 61;

/// What a decoder found in a segment of pictures, in the unit of its media's time stamps.
struct Pictures {
  std::uint64_t frames = 0;
  std::optional<std::int64_t> first, last, turned;  // as count_frames() says
};

Pictures pictures_in(BoxPool& boxes, const archive::StreamInfo& stream, const archive::SegmentEntry& entry,
                     const SealedSegment& segment) {
  const nlohmann::json asked{
      {"media", media_of(stream, entry)}, {"name", entry.file.file}, {"complete", entry.complete}};
  const nlohmann::json counted = boxes.with([&](BoxedJobs& box) {
    return box.ask(kCountFrames, asked,
                   [&](std::uint64_t) { return std::make_unique<BorrowedSource>(segment); }, entry.file.file,
                   nullptr, {.whole = kLongestCounting});
  });
  const auto number = [&](const char* key) -> std::optional<std::int64_t> {
    const auto found = counted.find(key);
    if (found == counted.end()) return std::nullopt;
    const bool fits = found->is_number_integer() && (!found->is_number_unsigned() ||
                                                     found->get<std::uint64_t>() <= std::uint64_t{INT64_MAX});
    if (!fits)
      throw MediaError("the media of " + entry.file.file +
                       " cannot be decoded: the decoder says what it may not");
    return std::clamp(found->get<std::int64_t>(), -kFurthest, kFurthest);
  };
  const std::optional<std::int64_t> frames = number("frames");
  if (!frames || *frames < 0)
    throw MediaError("the media of " + entry.file.file +
                     " cannot be decoded: the decoder says what it may not");
  return {static_cast<std::uint64_t>(*frames), number("first"), number("last"), number("turned")};
}

/// What time stamps in the file say against the entry. Nobody knows those of a segment that recovery found;
/// of one that was cut off the first ones are there.
std::optional<InspectionProblem> compare_stamps(const archive::StreamInfo& stream,
                                                const archive::SegmentEntry& entry,
                                                const Pictures& pictures) {
  const std::string& name = entry.file.file;
  if (pictures.turned)
    return InspectionProblem{"picture " + std::to_string(*pictures.turned) + " of " + name +
                             " is not stamped later than the one before it"};
  if (!entry.counted || !pictures.first || !pictures.last) return std::nullopt;
  const std::string media = media_of(stream, entry);
  const std::int64_t per_second = archive::unit_of_media(media).per_second;
  const std::int64_t apart = *pictures.first - entry.first_pts;
  if ((media == "video/mp2t" ? unwrapped(apart) : apart) != 0)
    return InspectionProblem{"the first picture of " + name + " is stamped " +
                             std::to_string(*pictures.first) + ", the ledger states " +
                             std::to_string(entry.first_pts) + " (in units of " + entry.time_base + " s)"};
  const auto lasts = static_cast<double>(*pictures.last - *pictures.first) / static_cast<double>(per_second);
  const auto stated = static_cast<double>(entry.span.end_ns - entry.span.start_ns) / 1e9;
  // A burst is stamped up to that much later than it came, and no picture as the one before it.
  const auto pictures_there = static_cast<double>(pictures.frames);
  const double spread = static_cast<double>(archive::kLatestStampNs) / 1e9;
  if (lasts <= stated + spread + pictures_there / static_cast<double>(per_second)) return std::nullopt;
  return InspectionProblem{"by their time stamps the pictures of " + name + " last " + std::to_string(lasts) +
                               " s, by the ledger " + std::to_string(stated) + " s",
                           true};
}

/// Each line is in the segment of its time; of a segment that recovery found the times are estimates.
void require_within(std::int64_t time_ns, const archive::SegmentEntry& entry, const std::string& where) {
  const archive::Span& span = entry.span;
  if (!entry.counted || (time_ns >= span.start_ns - archive::kSeamToleranceNs &&
                         time_ns <= span.end_ns + archive::kSeamToleranceNs))
    return;
  throw MediaError(where + " is of " + std::to_string(time_ns) + " ns, the segment of " +
                   std::to_string(span.start_ns) + " to " + std::to_string(span.end_ns) + " ns");
}

bool is_object(std::string_view line) {
  const std::size_t first = line.find_first_not_of(" \t\r");
  return first != std::string_view::npos && line[first] == '{' && nlohmann::json::accept(line);
}

/// Throws MediaError for a line that is none, and for a vital sign outside the segment's time.
std::uint64_t count_lines(const archive::StreamInfo& stream, const archive::SegmentEntry& entry,
                          const SealedSegment& segment) {
  std::uint64_t lines = 0;
  for_each_line(segment, entry.file.file, kMaximumVitalLineBytes, !entry.complete,
                [&](std::uint64_t number, std::string_view line) {
                  const std::string where = "line " + std::to_string(number) + " of " + entry.file.file;
                  if (stream.kind == "vitals") {
                    const VitalLineParse parse = parse_vital_line_of_any_kind(line);
                    if (!parse.line) {
                      throw MediaError(where + " is no vital sign: " + parse.problem);
                    }
                    require_within(time_ns_of(*parse.line), entry, where);
                  } else if (!is_object(line)) {
                    throw MediaError(where + " is no JSON object");
                  }
                  ++lines;
                });
  return lines;
}

std::optional<InspectionProblem> compare_count(const archive::StreamInfo& stream,
                                               const archive::SegmentEntry& entry, std::uint64_t counted,
                                               bool lines) {
  if (!entry.complete || !entry.counted || counted == entry.frames) return std::nullopt;
  const std::string what = stream.kind == "vitals" ? " samples" : lines ? " lines" : " frames";
  return InspectionProblem{entry.file.file + " holds " + std::to_string(counted) + what +
                           ", the ledger states " + std::to_string(entry.frames)};
}

std::optional<InspectionProblem> inspect(BoxPool& boxes, const archive::StreamInfo& stream,
                                         const archive::SegmentEntry& entry, const crypto::ByteSource& sealed,
                                         const crypto::AgeIdentities& identities) {
  try {
    const SealedSegment segment = SealedSegment::decrypt(sealed, entry.complete, identities);
    if (stream.media == "application/jsonl")
      return compare_count(stream, entry, count_lines(stream, entry, segment), true);
    const Pictures pictures = pictures_in(boxes, stream, entry, segment);
    if (auto problem = compare_count(stream, entry, pictures.frames, false)) return problem;
    return compare_stamps(stream, entry, pictures);
  } catch (const IoError&) {
    throw;  // says nothing of the segment
  } catch (const crypto::SourceChanged&) {
    throw;
  } catch (const Error& error) {
    return InspectionProblem{error.what()};
  }
}

}  // namespace

archive::SegmentInspector decoding_inspector() {
  return [boxes = std::make_shared<BoxPool>()](
             const archive::StreamInfo& stream, const archive::SegmentEntry& entry,
             const crypto::ByteSource& sealed, const crypto::AgeIdentities& identities) {
    return inspect(*boxes, stream, entry, sealed, identities);
  };
}

}  // namespace kiroku::media

#include "media/inspection/inspector.h"

#include <nlohmann/json.hpp>

#include "archive/format/segment_media.h"
#include "base/error.h"
#include "crypto/hashed_source.h"
#include "media/borrowed_source.h"
#include "media/box/boxed_jobs.h"
#include "media/inspection/frame_count_job.h"
#include "media/plaintext_lines.h"
#include "media/sealed_segment.h"
#include "media/segment_input.h"
#include "media/vital_line.h"

namespace kiroku::media {
namespace {

/// Of one segment. The box takes ten minutes of a processor at most.
constexpr std::chrono::hours kLongestCounting{1};

std::uint64_t count_frames_boxed(BoxPool& boxes, const archive::StreamInfo& stream,
                                 const archive::SegmentEntry& entry, const SealedSegment& segment) {
  const nlohmann::json asked{
      {"media", media_of(stream, entry)}, {"name", entry.file.file}, {"complete", entry.complete}};
  const nlohmann::json counted = boxes.with([&](BoxedJobs& box) {
    return box.ask(kCountFrames, asked,
                   [&](std::uint64_t) { return std::make_unique<BorrowedSource>(segment); }, entry.file.file,
                   nullptr, {.whole = kLongestCounting});
  });
  const auto frames = counted.find("frames");
  if (frames == counted.end() || !frames->is_number_unsigned())
    throw MediaError("the media of " + entry.file.file +
                     " cannot be decoded: the decoder says what it may not");
  return frames->get<std::uint64_t>();
}

bool is_object(std::string_view line) {
  const std::size_t first = line.find_first_not_of(" \t\r");
  return first != std::string_view::npos && line[first] == '{' && nlohmann::json::accept(line);
}

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
                  } else if (!is_object(line)) {
                    throw MediaError(where + " is no JSON object");
                  }
                  ++lines;
                });
  return lines;
}

std::optional<std::string> inspect(BoxPool& boxes, const archive::StreamInfo& stream,
                                   const archive::SegmentEntry& entry, const crypto::ByteSource& sealed,
                                   const crypto::AgeIdentities& identities) {
  try {
    const SealedSegment segment = SealedSegment::decrypt(sealed, entry.complete, identities);
    const bool lines = stream.media == "application/jsonl";
    const std::uint64_t counted =
        lines ? count_lines(stream, entry, segment) : count_frames_boxed(boxes, stream, entry, segment);
    if (entry.complete && entry.counted && counted != entry.frames) {
      const std::string what = stream.kind == "vitals" ? " samples" : lines ? " lines" : " frames";
      return entry.file.file + " holds " + std::to_string(counted) + what + ", the ledger states " +
             std::to_string(entry.frames);
    }
    return std::nullopt;
  } catch (const IoError&) {
    throw;  // says nothing of the segment
  } catch (const crypto::SourceChanged&) {
    throw;
  } catch (const Error& error) {
    return error.what();
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

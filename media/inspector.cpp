#include "media/inspector.h"

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "crypto/hashed_source.h"
#include "media/picture_decoder.h"
#include "media/plaintext_lines.h"
#include "media/sealed_segment.h"
#include "media/segment_input.h"
#include "media/vital_line.h"

namespace kiroku::media {
namespace {

std::uint64_t count_frames(const archive::StreamInfo& stream, const archive::SegmentEntry& entry,
                           const SealedSegment& segment) {
  std::uint64_t frames = 0;
  try {
    SegmentInput input(segment, stream.media, entry.file.file);
    PictureDecoder decoder(input, entry.file.file);
    while (decoder.next()) {
      ++frames;
    }
  } catch (const MediaError&) {  // cut off, perhaps before its first picture
    if (entry.complete) {
      throw;
    }
  }
  return frames;
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
                  } else if (!line.starts_with('{') || !nlohmann::json::accept(line)) {
                    throw MediaError(where + " is no JSON object");
                  }
                  ++lines;
                });
  return lines;
}

std::optional<std::string> inspect(const archive::StreamInfo& stream, const archive::SegmentEntry& entry,
                                   const crypto::ByteSource& sealed,
                                   const crypto::AgeIdentities& identities) {
  try {
    const SealedSegment segment = SealedSegment::decrypt(sealed, entry.complete, identities);
    const bool lines = stream.media == "application/jsonl";
    const std::uint64_t counted =
        lines ? count_lines(stream, entry, segment) : count_frames(stream, entry, segment);
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
  silence_libav();
  return inspect;
}

}  // namespace kiroku::media

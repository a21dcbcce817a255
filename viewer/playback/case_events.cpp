#include "viewer/playback/case_events.h"

#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "archive/format/event_line.h"
#include "archive/format/pointing_stream.h"
#include "archive/reading/committed_events.h"
#include "base/foreign_json.h"
#include "media/plaintext_lines.h"

namespace kiroku::playback {

std::size_t for_each_event(const CaseMedia& media,
                           const std::function<void(const nlohmann::json& event)>& visit) {
  archive::CommittedEvents committed(media.recording());
  if (committed.lacking() == 0) return 0;
  for (const archive::StreamInfo& stream : media.recording().opening().streams) {
    if (stream.kind != "events" || archive::is_pointing(stream)) continue;
    for (const archive::SegmentEntry& segment :
         media.recording().segments(stream.name, INT64_MIN, INT64_MAX)) {
      if (media.recording().is_erased(segment)) continue;
      const media::SealedSegment plain = media.open(segment);
      media::for_each_line(plain, segment.file.file, archive::kLongestEventLine, !segment.complete,
                           [&](std::uint64_t, std::string_view line) {
                             const std::optional<std::string> text = committed.take(line);
                             if (!text) return;
                             const nlohmann::json event = parse_foreign_json(*text);
                             if (event.is_object()) visit(event);
                           });
    }
  }
  return committed.lacking();
}

}  // namespace kiroku::playback

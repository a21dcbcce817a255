#include "media/recorded_lines.h"

#include "archive/format/case_folder.h"
#include "media/plaintext_lines.h"
#include "media/sealed_segment.h"
#include "media/vital_sample.h"

namespace kiroku::media {

void for_each_recorded_line(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                            const std::string& stream, std::int64_t from_ns, std::int64_t to_ns,
                            const std::function<void(std::string_view line)>& visit) {
  const archive::CaseFolder folder = archive::CaseFolder::open(recording.folder());
  for (const archive::SegmentEntry& entry : recording.segments(stream, from_ns, to_ns)) {
    if (recording.is_erased(entry)) continue;
    const SealedSegment segment = SealedSegment::open(folder, entry, identities);
    for_each_line(segment, entry.file.file, kMaximumVitalLineBytes, !entry.complete,
                  [&](std::uint64_t, std::string_view line) { visit(line); });
  }
}

}  // namespace kiroku::media

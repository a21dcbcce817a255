#include "archive/format/sealed_file.h"

#include "archive/format/limits.h"

namespace kiroku::archive {

bool may_have_holes(const SegmentEntry& segment) { return !segment.complete || !segment.counted; }

std::optional<std::string> why_not_sealed(const ReadableFile& file, const SegmentEntry& segment) {
  const std::uint64_t stated = segment.file.bytes;
  if (file.size() != stated) {
    return "has " + std::to_string(file.size()) + " bytes, not " + std::to_string(stated);
  }
  if (file.size() > kMaximumSealedBytes) {
    return "has " + std::to_string(file.size()) + " bytes, more than the 1 GiB that a segment may have";
  }
  if (!may_have_holes(segment)) {
    if (const std::optional<std::uint64_t> hole = file.first_hole()) {
      return "has a hole from byte " + std::to_string(*hole) + " on, where a segment has none";
    }
  }
  return std::nullopt;
}

}  // namespace kiroku::archive

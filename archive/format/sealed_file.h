// Whether a file can be the segment that a ledger states, told without reading it: a file that is a hole
// takes no room on a disk, and can be as long as one likes. Functions; thread-safe.
#pragma once

#include <optional>
#include <string>

#include "archive/format/case_folder.h"
#include "archive/format/ledger_entry.h"

namespace kiroku::archive {

/// Of a segment that was counted and finished every byte was sealed and flushed. What was found after a
/// crash, or ends where the disk was full, may have blocks that were never written.
bool may_have_holes(const SegmentEntry& segment);

/// Why it cannot be ("has 3 bytes, not 4"); nothing if it can. Throws kiroku::IoError.
std::optional<std::string> why_not_sealed(const ReadableFile& file, const SegmentEntry& segment);

}  // namespace kiroku::archive

// The stream of a case in which it stands where people pointed on its live pictures
// (docs/reference/format-streams.md, "Pointing"). Its kind is that of events, but no mark of the ledger
// commits to its lines.
#pragma once

#include <string_view>

#include "archive/format/case_layout.h"
#include "archive/format/ledger_entry.h"

namespace kiroku::archive {

inline constexpr std::string_view kPointingStream = "pointing";

inline bool is_pointing(const StreamInfo& stream) {
  return stream.kind == "events" && stream.name == kPointingStream;
}
/// Lines to which marks of the ledger commit.
inline bool holds_marks(const StreamInfo& stream) {
  return stream.kind == "events" && stream.media == kLinesMedia && !is_pointing(stream);
}

}  // namespace kiroku::archive

// What a list of cases shows of one, counted from its ledger without parsing every line: only the first and
// the `close` line are, the others are recognised by how they begin (`erased` and `recovered`
// are rare). A quick look, not a verification. Pure
// functions, thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/utc_time.h"

namespace kiroku::archive {

struct LedgerSummary {
  UtcTime opened;
  /// From the case's beginning to `close`; of a recovered case, to the last entry before it was cut off.
  /// Nothing while it is not closed.
  std::optional<std::int64_t> duration_ns;
  std::vector<std::string> streams;
  std::uint64_t segments = 0, bytes = 0, tokens = 0;  // what was erased is not among the first two
};

/// Nothing where the folder holds no ledger that can be read: no `open` first, a line that is no entry, a
/// line longer than the format's. A last line without LF is left out.
std::optional<LedgerSummary> summarise_ledger(const std::filesystem::path& case_folder);

}  // namespace kiroku::archive

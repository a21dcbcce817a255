// The end of a case's ledger, read backwards: whether the case was brought to its end, without reading the
// hours before. A quick look, not a verification. Functions, thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "archive/format/file_reading.h"
#include "archive/format/ledger_entry.h"

namespace kiroku::archive {

struct LedgerTail {
  std::uint64_t entries = 0;        // by the last line's seq
  bool closed = false;              // `close` stands there, followed by nothing but what may follow it
  bool covered = false;             // there is a checkpoint of that size
  std::vector<ErasedEntry> erased;  // after `close`
};

/// Nothing where the ledger cannot be read, or does not end with a whole entry.
std::optional<LedgerTail> read_ledger_tail(const std::filesystem::path& case_folder,
                                           const FileReading& files = real_reading());

}  // namespace kiroku::archive

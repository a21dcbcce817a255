// What an archive's own appliance log states, for whoever acts by it: holds, consents. A function; one thread
// at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "archive/format/log_entry.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

/// One entry that was asked for.
struct StatedEntry {
  const LogEntry& entry;
  std::uint64_t number = 0;  // its line's, from 0
  /// Whether the home's device signed it before another entry followed. A key that the log names does not
  /// count: it is for whoever wrote to the disk to choose.
  std::function<bool()> is_signed;
};

/// What is asked of a log.
struct StatedQuestion {
  std::string what;                         // completes "nobody can tell …"
  std::span<const std::string_view> types;  // of entries
  std::function<void(const StatedEntry&)> visit;
};

/// Reads the whole log and visits the entries of those types, in order. `device` is the home's. `seen` is a
/// checkpoint of the log that others saw. Throws kiroku::Error where nobody can tell what the log said: it
/// says itself that lines of it were changed, does not
/// fit its newest checkpoint or `seen`, is shorter than `seen`, does not go on from what a case of
/// `device` in the archive states of it, tells of more than starts of the
/// machine without any checkpoint, that is not signed by `device`, or the log is not there while a case that
/// was recorded beside one lies in the archive. What was visited until then counts for nothing. An archive
/// without log and cases states nothing.
void read_stated(const std::filesystem::path& log_folder, const crypto::VerifierKey& device,
                 const std::optional<crypto::Checkpoint>& seen, const StatedQuestion& question);

}  // namespace kiroku::archive

// Erasing the segments of one stream of a closed case (docs/reference/format-recovery.md, "Retention"): their
// bytes go, their hashes and the proof of everything else stay. Functions; one thread at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "archive/upkeep/recovery.h"

namespace kiroku::archive {

struct RetentionOptions {
  const crypto::SigningKey* key = nullptr;
  std::string device_name;
  ApplianceLog* log = nullptr;  // may be null (tests)
  CheckpointStamper stamp;      // may be empty: then `token-missed` says so
  std::function<UtcTime()> now = utc_now;
  /// Asked of the case's first entry, and of when all entries say it was opened (archive/upkeep/age.h), when
  /// its ledger is held and its signatures were compared: whoever chose the case read it before, and it may
  /// have been changed for that moment. It is asked in the turn to erase, so it must not take that. False:
  /// nothing is erased, as somebody changed the archive. It throws kiroku::UsageError for any other reason.
  /// May be empty.
  std::function<bool(const OpenEntry&, UtcTime opened)> may_go;
};

struct Erasure {
  std::uint64_t segments = 0;  // erased now
  std::uint64_t bytes = 0;
  bool stamped = false;  // the erasure has a token
};

/// Erases every segment of the stream that is not erased yet. First `erased` is durable in the ledger,
/// signed, in the appliance log and time-stamped; only then files are removed. Cut off before that, nothing
/// is lost; after it, the next erasure or start-up removes the rest. Throws UsageError if the case is not
/// closed and signed to its end, if it has no such stream, if `policy` is empty, if another process writes
/// the case or another device recorded it, if a legal hold of the case stands, or if `may_go` says no;
/// kiroku::Error where it cannot be told whether one does, and where the device's hardware signed the case
/// and does not answer; kiroku::IoError.
Erasure erase_stream(FileSystem& files, const RetentionOptions& options, const std::filesystem::path& folder,
                     const std::string& stream, const std::string& policy);

/// Files that `erased` entries name and that are still there. Throws kiroku::IoError.
std::vector<std::filesystem::path> files_to_erase(const FileReading& files,
                                                  const std::filesystem::path& folder,
                                                  const std::vector<ErasedEntry>& erased);
/// Removes them, durably. Throws kiroku::IoError.
void remove_erased(FileSystem& files, const std::vector<std::filesystem::path>& to_erase);
/// Has the newest state of a closed case time-stamped and enters the answers; whether there is a token.
bool stamp_end(CaseWriter& writer, const CheckpointStamper& stamper, const std::function<Moment()>& now);

}  // namespace kiroku::archive

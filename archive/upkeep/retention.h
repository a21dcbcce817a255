// Erasing the segments of one stream of a closed case (docs/reference/format-recovery.md, "Retention"): their
// bytes go, their hashes and the proof of everything else stay. Functions; one thread at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "archive/upkeep/recovery.h"
#include "base/error.h"

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
  /// Files that an erasure before, which was cut off, had left: removed now.
  std::uint64_t left_before = 0;
  /// What is not as it was recorded, a sentence for each file. It is not stated as erased and stays as it is:
  /// whoever verifies the case is told of it as before.
  std::vector<std::string> not_as_recorded;
};

/// The ledger says that the stream was erased, and not all of its files are gone.
class ErasureCutOff : public Error {
 public:
  using Error::Error;
};

/// Erases every segment of the stream that is not erased yet and is as it was recorded, which is compared by
/// reading all of them. First `erased` is durable in the ledger,
/// signed, in the appliance log and time-stamped; only then files are removed. Cut off before that, nothing
/// is lost; after it, the next erasure or start-up removes the rest. Throws UsageError if the case is not
/// closed and signed to its end, if it has no such stream, if `policy` is empty, if another process writes
/// the case or another device recorded it, if a legal hold of the case stands, or if `may_go` says no;
/// kiroku::Error where it cannot be told whether one does, and where the device's hardware signed the case
/// and does not answer; ErasureCutOff; kiroku::IoError.
Erasure erase_stream(FileSystem& files, const RetentionOptions& options, const std::filesystem::path& folder,
                     const std::string& stream, const std::string& policy);

/// Files that `erased` entries name and that are still there. Throws kiroku::IoError.
std::vector<std::filesystem::path> files_to_erase(const FileReading& files,
                                                  const std::filesystem::path& folder,
                                                  const std::vector<ErasedEntry>& erased);
/// Removes them, durably. Throws kiroku::IoError.
void remove_erased(FileSystem& files, const std::vector<std::filesystem::path>& to_erase);
/// Why a start does not remove what an erasure that was cut off had left: the appliance log says of the case
/// that it was held, released, or that a consent was given again, and not behind that that it was erased. ""
/// where there is no such thing. Reads the whole log. Throws kiroku::Error.
std::string why_erasure_waits(const std::filesystem::path& log_folder, const std::string& case_id);
/// Has the newest state of a closed case time-stamped and enters the answers; whether there is a token.
bool stamp_end(CaseWriter& writer, const CheckpointStamper& stamper, const std::function<Moment()>& now);

}  // namespace kiroku::archive

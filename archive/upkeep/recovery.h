// Bringing cases to their end whose recorder died: power cut, crash, kill (docs/reference/format-recovery.md,
// "Recovery"). It uses the writer that recording uses, so what it leaves is what recording leaves. Everything
// it does may be cut off as well: the next start takes it up from what is there. Finished, entered segments
// are not read again, so ten hours take seconds. Functions; one thread at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "archive/format/limits.h"
#include "archive/storage/recording_lock.h"
#include "archive/writing/case_writer.h"
#include "timestamp/token_verifier.h"

namespace kiroku::archive {

class ApplianceLog;

/// What one authority answered over a checkpoint.
struct CheckpointStamp {
  std::string authority;     // short name
  Bytes response;            // the token, judged valid; empty if there is none
  TokenEntry facts;          // gen_time, accuracy_ns and serial of it
  std::vector<Bytes> chain;  // DER certificates
  std::string cause;         // one sentence where there is no token
};
/// Has a checkpoint time-stamped: one answer from each authority. May take as long as authorities do.
using CheckpointStamper = std::function<std::vector<CheckpointStamp>(const StoredCheckpoint&)>;

/// A case that was cut off while it was recorded, as its ledger tells.
struct CutOffCase {
  std::string case_id;
  std::filesystem::path folder;
  std::string boot_id;  // of the machine when it was cut off
  Moment opened;        // when `open` was written
  Moment last;          // when the last entry before the cut was
  /// Nobody signed that it was opened, the earlier case announces it, and its subject is not that case's.
  bool brings_subject = false;
};

struct RecoveryOptions {
  std::filesystem::path archive;
  const crypto::SigningKey* key = nullptr;
  std::string device_name;
  std::string boot_id;          // of the machine as it runs now: another one means that power was lost
  ApplianceLog* log = nullptr;  // may be null (tests)
  /// False where nobody knows by the log what is held: what is left of an erasure that was cut off stays.
  bool may_erase = true;
  CheckpointStamper stamp;  // may be empty: then `token-missed` says so
  /// Tokens that lie in a case without an entry are entered only if they are valid under these roots. Null:
  /// any that is over its checkpoint.
  const timestamp::TrustStore* trust = nullptr;
  /// The identifier of the case that will carry on the one that was cut off: its `close` announces it; ""
  /// where none will. May be empty. Not asked of a case of which no signature shows that it is the device's,
  /// unless it carries on one that announces it.
  std::function<std::string(const CutOffCase&)> carry_on;
  std::function<UtcTime()> now = utc_now;
  /// Of segments that no entry names so many bytes are taken up of a case; what is beyond is left as it is.
  std::uint64_t most_found_bytes = kMostBytesFound;
};

/// What became of one unfinished case.
struct CaseRecovery {
  enum class Outcome {
    kRecovered,  // it was cut off while it was recorded: now closed
    kFinished,   // it was closed, but not stamped, signed or logged to its end: now it is
    kNotBegun,   // it was never more than a hidden folder: removed
    kRefused     // left as it is; `problem` says why
  };
  std::string case_id;
  std::filesystem::path folder;
  Outcome outcome = Outcome::kRecovered;
  std::string after;               // kRecovered: "power-loss", "crash"
  std::string truncated;           // kRecovered: what was cut off, as `recovered` states it
  std::uint64_t segments = 0;      // that no entry named and now one does
  std::uint64_t incomplete = 0;    // of these
  std::uint64_t tokens = 0;        // likewise
  std::vector<GapEntry> gaps;      // stated now
  bool stamped = false;            // the end has a token
  std::uint64_t erased_files = 0;  // that an erasure which was cut off had left: removed now
  std::string problem;             // a sentence, also where it was recovered but something was left aside
};

/// Looks for unfinished cases and brings each to its end, oldest first. A case that fails is reported as
/// kRefused and does not keep others from being recovered. The lock shows that no recorder is alive. Throws
/// kiroku::IoError only if the archive folder cannot be read.
std::vector<CaseRecovery> recover_archive(FileSystem& files, const RecoveryOptions& options,
                                          const RecordingLock& lock);

}  // namespace kiroku::archive

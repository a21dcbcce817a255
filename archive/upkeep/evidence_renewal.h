// Evidence records of a whole archive: begun for closed cases that have none, renewed where something ends
// soon (docs/explanation/evidence.md). One token for all that need the same kind of renewal. Functions; one
// thread at a time in an archive, which EvidenceLock sees to among processes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/storage/file_system.h"
#include "evidence/renewal.h"

namespace kiroku::archive {

struct EvidenceRenewalOptions {
  const timestamp::TrustStore* trust = nullptr;
  evidence::Policy policy = evidence::Policy::without_ends();
  std::function<UtcTime()> now = utc_now;
  evidence::Stamp stamp;  // throws kiroku::Error where no authority answers
  bool dry_run = false;   // says what is due; asks nobody, and reads no recording
  /// Renews the hash tree of records whose case has entries behind what they cover, also where nothing is
  /// due: with the policy's new hash, which may be the old one. Nothing else takes such entries in.
  bool take_in = false;
  /// Hash values and records that are held at once, about. What is beyond that gets a token of its own.
  std::size_t most_bytes = 256U << 20U;
};

struct EvidenceRenewal {
  enum class What {
    kBegun,
    kTimeStampRenewed,
    kHashTreeRenewed,
    kNothingDue,
    kStillOpen,  // it is being recorded, or was not brought to its end: left alone
    kWaits,      // something is due, and no authority answered, or none whose time-stamp lasts longer
    kRefused,    // nothing was done for this case, and somebody must look at it; the text says why
  };
  std::string case_id;
  What what = What::kRefused;
  std::string text;               // a phrase: what was due, or why nothing was done
  std::optional<UtcTime> before;  // when the record must be renewed; nothing where no end is known
  /// Entries of the case behind what its record covers, as an erasure or a late token: the record says
  /// nothing of them. 0 where something else is done or told.
  std::uint64_t later_entries = 0;
  std::vector<std::string> unread;  // files that could not be read, or are not as the ledger states
};
/// "begun", "time-stamp-renewed", … "refused".
std::string_view name_of(EvidenceRenewal::What what);

/// Keeps a second process from renewing in an archive at the same time.
class EvidenceLock {
 public:
  /// Makes the folder of records if need be. Throws kiroku::UsageError where another process renews there,
  /// kiroku::IoError where this one may not write there.
  static EvidenceLock take(FileSystem& files, const std::filesystem::path& archive);

 private:
  explicit EvidenceLock(std::unique_ptr<WritableFile> file) : file_(std::move(file)) {}
  std::unique_ptr<WritableFile> file_;
};

/// Does what is due for these cases (folders of one archive); the answers are in their order. A case is
/// refused that is tampered with, or has data that cannot be read; and one whose record does not hold. What
/// is due is told by a record alone, which is compared with one note of its case, and with the ledger where
/// it does not hold the newest note. A time-stamp renewal compares it with ledger and notes, and reads no
/// recording. The others read all data.
///
/// Every token is judged with its record before that is written; a record is replaced durably. One that rests
/// on outside authorities alone is never renewed by the recorder's own.
std::vector<EvidenceRenewal> renew_evidence(FileSystem& files,
                                            const std::vector<std::filesystem::path>& cases,
                                            const EvidenceRenewalOptions& options);

}  // namespace kiroku::archive

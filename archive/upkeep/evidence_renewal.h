// Evidence records of many cases, wherever these lie: begun for closed cases that have none, renewed where
// something ends soon (docs/explanation/evidence.md). One token for all that need the same kind of renewal.
// Functions; one thread at a time in an archive, which EvidenceLock sees to among processes.
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
#include "base/error.h"
#include "crypto/hash.h"
#include "evidence/renewal.h"

namespace kiroku::archive {

/// A case whose record may be due, wherever it lies. Used by one thread; files() may be read from several.
class RenewableCase {
 public:
  RenewableCase() = default;
  RenewableCase(const RenewableCase&) = delete;
  RenewableCase& operator=(const RenewableCase&) = delete;
  virtual ~RenewableCase() = default;
  /// What it is called until its ledger says so.
  [[nodiscard]] virtual std::string name() const = 0;
  /// Its folder, of which files() reads everything until let_go(). Throws kiroku::Error, RenewalWaits.
  virtual std::filesystem::path folder() = 0;
  virtual const FileReading& files() = 0;
  /// Where its record lies, for sentences.
  [[nodiscard]] virtual std::string record_place(const std::string& case_id) const = 0;
  /// Every record that there is of it, each once; a folder has one. Also after let_go(). Throws
  /// kiroku::Error, RenewalWaits.
  virtual std::vector<Bytes> read_records(const std::string& case_id) = 0;
  /// Whether all that a record covers was compared with the case before, or it was made for it.
  [[nodiscard]] virtual bool is_known_to_hold(const crypto::Sha256Digest& /*record*/) const { return false; }
  /// Whether every record stays that was ever there. Only then one may be begun beside one that does not
  /// hold.
  [[nodiscard]] virtual bool keeps_all_records() const { return false; }
  /// Durable when it returns. Throws kiroku::Error, RenewalWaits.
  virtual void write_record(const std::string& case_id, ByteView record) = 0;
  /// Nothing but its record is read any more. Throws RenewalWaits where what could not be read before says
  /// nothing of the case: then nothing that was found of it counts.
  virtual void let_go() {}
};

/// Something that comes by itself, or that others may give: nothing is wrong with the case.
class RenewalWaits : public Error {
 public:
  using Error::Error;
};

struct EvidenceRenewalOptions {
  const timestamp::TrustStore* trust = nullptr;
  evidence::Policy policy = evidence::Policy::without_ends();
  std::function<UtcTime()> now = utc_now;
  evidence::Stamp stamp;  // throws kiroku::Error where no authority answers
  bool dry_run = false;   // says what is due; asks nobody, and reads no recording
  /// Renews the hash tree of records whose case has entries behind what they cover, also where nothing is
  /// due: with the policy's new hash, which may be the old one. Nothing else takes such entries in.
  bool take_in = false;
  /// Begins a record beside those that do not hold, where all of them stay.
  bool begin_anew = false;
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
  /// SHA-256 of the record that stands, where it was made here, or all that it covers was compared with the
  /// case, now or before.
  std::optional<crypto::Sha256Digest> holds;
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

/// Does what is due for these cases; the answers are in their order. A case is
/// refused that is tampered with, or has data that cannot be read; and one whose record does not hold. What
/// is due is told by a record alone, which is compared with one note of its case, and with the ledger where
/// it does not hold the newest note. A time-stamp renewal compares it with ledger and notes, and reads no
/// recording. The others read all data.
///
/// Every token is judged with its record before that is written; a record is replaced durably. One that rests
/// on outside authorities alone is never renewed by the recorder's own.
///
/// Of several records of a case the one counts that choose_record() says.
std::vector<EvidenceRenewal> renew_evidence(const std::vector<std::unique_ptr<RenewableCase>>& cases,
                                            const EvidenceRenewalOptions& options);
/// The same of cases in folders, with their records where kiroku-verify looks for them.
std::vector<EvidenceRenewal> renew_evidence(FileSystem& files,
                                            const std::vector<std::filesystem::path>& cases,
                                            const EvidenceRenewalOptions& options);

}  // namespace kiroku::archive

// Writes one case: ledger, checkpoints, tokens, subject. "One writer of the ledger": every function that
// appends is called from one thread; begin_segment alone may be called from any. Another process that would
// write the same ledger is refused.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "archive/format/case_layout.h"
#include "archive/format/ledger_entry.h"
#include "archive/verify/carried_on.h"
#include "archive/writing/segment_writer.h"
#include "crypto/age_recipient.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

class ApplianceLog;
class FileSystem;

/// A signed checkpoint on disk.
struct StoredCheckpoint {
  std::uint64_t size = 0;
  crypto::Sha256Digest root{};
  std::string note;  // the file's exact bytes: what a token is asked over
  std::filesystem::path file;
};

/// An identifier of a case that begins now: "20260805T091502Z-3f9c21ab".
std::string new_case_id(UtcTime now);

class CaseWriter {
 public:
  struct Options {
    std::filesystem::path archive;  // the archive folder; the case folder is made in it
    const crypto::SigningKey* key = nullptr;
    std::string device_name;  // name part of the verifier key
    std::vector<StreamInfo> streams;
    std::vector<crypto::AgeRecipients> stream_recipients;  // one a stream, same order
    std::optional<Bytes> subject;                          // plaintext JSON, sealed to subject_recipients
    crypto::AgeRecipients subject_recipients;
    std::string boot_id;
    ApplianceLog* log = nullptr;  // may be null (tests); receives case-opened, case-checkpoint, case-closed
    std::optional<crypto::Sha256Digest> plan;
    std::int64_t begins_ns = 0;  // OpenEntry::begins_ns
    std::string case_id;         // "": a new one
    std::optional<CarriedOn> carries_on;
    /// A subject file of the case that is carried on, sealed to whoever could open it there: copied as it is.
    /// Not beside `subject`.
    std::optional<Bytes> sealed_subject;
  };
  /// Makes the folder and writes `open` durably. The folder is made under a hidden name and gets its own when
  /// all of it is on the disk: a case without its `open` entry never exists, not even after a power cut.
  /// Throws kiroku::Error; nothing is left behind then, but for a case that is on the disk when the log
  /// cannot be written: it is left for recovery, since the log may know it. `files`, `key` and `log` must
  /// outlive the writer.
  static std::unique_ptr<CaseWriter> create(FileSystem& files, const Options& options, Moment now);

  /// Opens a case that stands on the disk, to bring it to its end (recovery.h) or to erase from it
  /// (retention.h): entries, tokens and checkpoints can be added as before, segments cannot be begun. A torn
  /// last line is cut off, and so is the end from the first `close` or `erased` on that no checkpoint covers:
  /// whoever can write to the disk could have put it there. `visit` is called with every entry, in order. Of
  /// an unfinished case nothing else is touched. Throws UsageError if another process is writing it, or if
  /// another device recorded it; kiroku::Error if the ledger is damaged, or its newest checkpoint or what
  /// `log` states of the case (case_against_log.h) does not fit it: then it must be verified, and not be
  /// signed again. `files`, `key` and `log` must outlive the writer.
  static std::unique_ptr<CaseWriter> resume(FileSystem& files, const std::filesystem::path& folder,
                                            const crypto::SigningKey& key, const std::string& device_name,
                                            ApplianceLog* log,
                                            const std::function<void(const CaseEntry&)>& visit);
  ~CaseWriter();

  [[nodiscard]] const std::string& case_id() const;
  [[nodiscard]] const std::filesystem::path& folder() const;
  /// How many entries there are, and how many of them the newest checkpoint covers.
  [[nodiscard]] std::uint64_t size() const;
  [[nodiscard]] std::uint64_t covered() const;
  /// Bytes of a torn last line that resume() cut off.
  [[nodiscard]] std::uint64_t torn_bytes() const;
  /// Bytes that it cut off because they begin with `close` or `erased`, which nobody had signed.
  [[nodiscard]] std::uint64_t unsigned_bytes() const;
  /// Whether a signature shows that the case is the device's: a checkpoint of its own, or the log's over
  /// `case-opened`. Without one a recorder had nothing but `open` in it; anybody could have made that.
  [[nodiscard]] bool opening_vouched() const;
  /// Of a case that resume() took up: whether its hardware vouches for all that its checkpoints cover, or the
  /// case is from before the device had any, by its log. What is signed from here on without the hardware
  /// makes such a case unproven.
  [[nodiscard]] bool rests_on_hardware() const;

  /// A new segment file of stream `stream_index` (position in Options::streams). `profile` as
  /// SegmentEntry::profile. Thread-safe.
  std::unique_ptr<SegmentWriter> begin_segment(std::size_t stream_index, std::uint64_t segment_index,
                                               const std::string& profile = {});

  /// Moves a finished segment file that was recorded ahead of the case (archive/upkeep/standby_folder.h) to
  /// the place of `segment.index`, durably, and sets `segment.file.file`; it is entered by append(). Throws
  /// kiroku::IoError.
  void take_in(SegmentEntry& segment, const std::filesystem::path& from);

  /// Appends and makes durable; several bodies share one fsync. Segment entries must name files as commit()
  /// or salvage() returned them, which are there with that size, in rising index a stream; nothing is written
  /// otherwise (UsageError). `mono_ns` never goes back: an earlier one is entered as the last one. Totals for
  /// `close` are kept here. Throws kiroku::IoError; on a full disk the archive's reserve is used first. After
  /// a failed fsync the writer refuses everything (it is never retried).
  void append(const std::vector<CaseEntryBody>& bodies, Moment now);
  /// Signs the tree as it is and stores the note; also logged in the appliance log the first time, when a
  /// minute has passed since, or when `log_it` is set.
  StoredCheckpoint checkpoint(Moment now, bool log_it = false);
  /// Stores a response or a shared token (evidence/shared_token.h) durably, then appends its `token` entry
  /// (also after close()). `authority` is a short name [a-z0-9-]. Of `facts` gen_time, accuracy_ns, serial
  /// and exchange are read; the rest is filled in. A second token of one authority over one checkpoint is
  /// refused (UsageError).
  void add_token(const StoredCheckpoint& over, const std::string& authority, ByteView response,
                 const TokenEntry& facts, Moment now);
  /// Where something lies under the name of that token already, which add_token() refuses: what is to be
  /// entered instead. Whoever can write to the disk knows these names, and what they put there must keep no
  /// case from its end.
  [[nodiscard]] std::optional<TokenMissedEntry> token_in_the_way(std::uint64_t checkpoint,
                                                                 const std::string& authority) const;
  /// Appends the entry of a token whose file is there already: the recorder died in between.
  void adopt_token(const TokenName& name, const TokenEntry& facts, Moment now);
  /// The authority's certificates, a convenience beside the tokens: none, and the same as last, are no write.
  void store_authority_chain(const std::string& authority, const std::vector<Bytes>& chain_der);
  /// Appends `close`. Only tokens, token-missed and erased may follow.
  void close(const std::string& reason, Moment now);
  /// After the closing token: the last checkpoint over its entry, and `case-closed` in the appliance log.
  StoredCheckpoint finish(Moment now);

 private:
  struct State;
  explicit CaseWriter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::archive

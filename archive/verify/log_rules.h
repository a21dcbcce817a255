// The appliance log: its own integrity, and what it knows of cases. Not thread-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <unordered_set>
#include <variant>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/line_reader.h"
#include "archive/format/log_entry.h"
#include "archive/verify/boot_rules.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/consent_rules.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/folder_names.h"
#include "archive/verify/outside_notes.h"
#include "archive/verify/report.h"
#include "archive/verify/verify_options.h"
#include "crypto/merkle_tree.h"

namespace kiroku::archive {

struct SignedLog;

/// A tree of a case as the log states it, in `entry` of the log.
struct KnownRoot {
  std::uint64_t size = 0;
  crypto::Sha256Digest root{};
  std::uint64_t entry = 0;
};

/// Another case that the log says was opened under an identifier that it knows already. No recorder does
/// that.
struct FurtherOpening {
  std::uint64_t entry = 0;
  crypto::Sha256Digest opening_line{};
  bool vouched = false;  // signed before another entry followed
};

/// A device as the log names it.
struct NamedDevice {
  std::string text;                        // as it stands there; empty: no line names one
  std::optional<crypto::VerifierKey> key;  // with what is known of it; nothing where that is none
};
/// Whether both are one device: by the same key. Two keys of one name are two devices, also where the
/// verifier trusts both: names are not unique, and nothing in a log proves that its device took another key.
/// Whoever has a copy of a log can carry it on under their own.
bool is_one_device(const NamedDevice& one, const NamedDevice& other);

/// What a log says of one case, in lines of the case's own device. Lines that stand there while the log is
/// another device's count for nothing.
struct LoggedCase {
  std::optional<std::uint64_t> opened;  // entry of case-opened
  std::optional<std::uint64_t> told;    // first entry of a checkpoint or an end of it
  crypto::Sha256Digest opening_line{};  // SHA-256 of entry 0 of the case
  std::vector<FurtherOpening> further;  // with other first lines; where all cases are kept
  std::vector<KnownRoot> roots;         // of case-checkpoint and case-closed
  std::optional<KnownRoot> closed;
  std::optional<crypto::Sha256Digest> final_token;
  /// The whole case, by an entry that was signed before another followed. A line that nobody signed then
  /// excuses nothing: anybody who can write to the disk can add one, and the next start signs what follows.
  /// No erasure excuses what was opened behind it.
  bool erased = false;
  /// Where all cases are kept: who told of it first, and so speaks for it. Of the others it is known whose
  /// they are.
  std::optional<NamedDevice> device;
  /// That device is trusted, or began the log: that its case is not there accuses.
  bool accuses = true;
  /// Whether any entry of the log about the case was signed before another followed.
  bool vouched = false;
};

/// What a walk over a log gives.
struct LogContents {
  std::map<std::string, LoggedCase> cases;
  LeftBySystems left;
  /// Of the entries about these cases those that nobody signed before another followed: the machine stopped
  /// at that moment, or somebody who can write to the disk made them up, and the next start signed them with
  /// its own. They prove nothing against a case either.
  std::unordered_set<std::uint64_t> doubted;
  std::optional<crypto::Sha256Digest> root_at_head;  // nothing: the log is shorter
  std::uint64_t entries = 0, checkpoints = 0;
  /// Entries that a checkpoint covers which that key of the case's device signed, while it was the log's. Of
  /// hardware only those that the log had when it began to sign, by the root that the device's identity
  /// states.
  EntriesBy vouched_for;
  std::uint64_t signed_entries = 0;  // that a checkpoint covers
  SignaturesChecked signatures = SignaturesChecked::kNone;
  std::string device;
  /// Of the case that the walk is for: an opening that the log states while it is not that case's device's.
  struct OpenedByAnother {
    std::uint64_t entry = 0;
    crypto::Sha256Digest opening_line{};
    bool by_nobody = false;  // no line that can be read names a device by then
    /// Signed before another entry followed, by a device that the verifier trusts, which does not trust the
    /// case's.
    bool accuses = false;
  };
  /// The first one that accuses; else the first one.
  std::optional<OpenedByAnother> opened_by_another;
  /// The first entry that tells of the case while the log is not its device's.
  std::optional<std::uint64_t> told_by_another;
  /// The log was its device's at any time.
  bool was_case_devices = false;
  /// The most entries that a checkpoint covers which the case's device signed. Whatever else a log holds,
  /// others can have written: that it lacks something there accuses nobody.
  std::uint64_t accusing = 0;
  /// No line is broken, and none lacks that something tells of.
  bool sound = true;
  std::optional<UtcTime> begins;
  bool gave_up = false;  // so many lines are no entries that the rest was not read: nothing follows from it
};

/// Walks a log once. Findings name files relative to the log's folder.
class LogWalk {
 public:
  /// For verifying the case that begins so: only what concerns it is kept, and the log's own root at the size
  /// that it states. Without one all cases are kept, and no roots. `of_cases` takes what the log says that
  /// was done to cases (consents, erasures); null: `findings` does, which takes what is found of the log
  /// itself. Everything referred to must outlive the object.
  LogWalk(const CaseFolder& folder, const VerifyOptions& options, FindingList& findings,
          const std::optional<OpenEntry>& of_case, FindingList* of_cases = nullptr);
  /// Notes to compare the log with, before run().
  void compare_with(OutsideNotes& notes) { outside_ = &notes; }
  /// Into an empty one, which must outlive run(); before that.
  void keep_for_comparison(SignedLog& log) { kept_ = &log; }

  /// Once. Throws kiroku::Error if the folder is no log.
  LogContents run();

 private:
  void take(const LedgerLine& line, const LogEntryParse& parse, std::uint64_t number,
            const std::optional<crypto::Sha256Digest>& root_before);
  void count_broken_line(std::uint64_t number);
  /// That a checkpoint of all until now holds, for a comparison.
  void keep_signed();
  void set_device(const std::string& device, std::uint64_t number);
  /// Whether the device that the log names now is trusted.
  void judge_named(const crypto::VerifierKey& key);
  /// At the end: of one that is neither, beside a case.
  void judge_stranger();
  /// A key beside Ed25519 that the log states against the one that is known.
  void judge_ml_dsa_key(const std::string& key, std::uint64_t number);
  void judge_hardware_key(const std::string& key, std::uint64_t number);
  /// What an entry claims of the log or of its device counts once a checkpoint covers it: anybody who can
  /// write to the disk adds a line, and the recorder's next start puts it aside.
  void claim(CodeName code, std::uint64_t number, std::string text);
  void tell_claims();
  void judge_damage(const LogDamageEntry& damage, std::uint64_t number);
  /// Before another device signs, or at the end.
  void keep_vouched_for();
  /// What is known of a case that entry `number` tells of; nothing where it is not asked for, or the log is
  /// another device's now.
  LoggedCase* logged(const std::string& case_id, std::uint64_t number);
  /// Whether the log is the device's now that speaks for the case.
  [[nodiscard]] bool is_its_devices(const std::string& case_id) const;
  void note_another(std::uint64_t number);
  [[nodiscard]] NamedDevice device_now() const { return {contents_.device, device_}; }
  [[nodiscard]] bool is_asked_for(const std::string& case_id) const;
  void note_root(const std::string& case_id, const KnownRoot& root);
  void check_names();
  /// Notes that were signed while the log was read, of the newest entries.
  void take_late_notes(bool tree_known);
  void judge_tail();
  /// After a checkpoint that covers all until now.
  void judge_signed();
  /// When it is known whether the newest entry, `number`, has a checkpoint of its own: here, or one that was
  /// kept elsewhere.
  void judge_told(std::uint64_t number, bool has_its_own);
  void judge_opening_by_another(std::uint64_t number, bool has_its_own);
  void judge_consents(std::uint64_t number, bool has_its_own);
  /// Of an entry that was signed before another followed; no other holds, releases or accuses.
  void judge_holds(std::uint64_t number);

  const CaseFolder* folder_;
  const VerifyOptions* options_;
  FindingList* findings_;
  FindingList* of_cases_;
  std::string case_id_, case_device_;
  std::optional<crypto::VerifierKey> signs_case_;  // case_device_, with what is known of it
  bool trusts_case_device_ = false;
  std::uint64_t from_before_hardware_ = 0;  // entries of the log by the root that its identity states
  std::uint64_t head_;
  OutsideNotes* outside_ = nullptr;
  SignedLog* kept_ = nullptr;
  std::map<std::string, std::size_t> kept_devices_;  // places in kept_->devices
  std::optional<std::string> signer_;                // the device's key, where it names one
  std::optional<crypto::VerifierKey> device_;        // the same, with what is known of it
  bool trusts_device_ = false;
  bool is_case_devices_ = false;                 // the case's device
  std::optional<crypto::VerifierKey> stranger_;  // beside a case the first other key that is not trusted
  std::optional<NamedDevice> first_device_;      // that the log names
  std::vector<ListedFile> listing_;
  CheckpointRules checkpoints_;
  crypto::MerkleFrontier tree_;
  LogContents contents_;
  bool names_device_ = false;  // an entry did, be it by a text that is none
  std::int64_t last_mono_ns_ = 0;
  std::deque<crypto::Checkpoint> recent_;     // of the newest sizes that no listed note has; without origin
  std::deque<std::uint64_t> to_be_followed_;  // the last two entries that a checkpoint follows at once
  bool opened_now_ = false;                   // whether it opens the case that it tells of
  std::optional<crypto::Sha256Digest> opened_by_another_now_;  // the first line that it states, if it is that
  std::optional<std::string> erased_now_;      // the case that the newest entry says was erased whole
  std::optional<std::string> told_now_;        // the case that the newest entry tells of, if it is kept
  std::optional<CaseClosedEntry> closed_now_;  // the newest entry, if it is this
  /// The newest entry, if it holds, releases or erases something of a case that is asked for.
  std::optional<std::variant<CaseHeldEntry, CaseReleasedEntry, CaseErasedEntry>> of_holds_now_;
  std::optional<LogEntryBody> of_consents_now_;  // the newest entry, if it concerns consents
  ConsentRules consents_;
  BootRules boots_;
  /// The entries of the holds of a case that stand: of its own device, and of others that the log was.
  struct Holds {
    std::set<std::uint64_t> own, of_others;
  };
  std::map<std::string, Holds> holds_;
  struct Claim {
    CodeName code;
    std::uint64_t number;
    std::string text;
  };
  std::vector<Claim> claims_;                       // that no checkpoint covers yet
  std::map<std::string, std::uint64_t> signed_by_;  // entries that a checkpoint covers, by each device's key
  std::uint64_t since_note_ = 0;  // entries to be followed, since the last checkpoint that fits
  std::uint64_t broken_lines_ = 0;
};

/// One case against what the log knows of it, while its ledger is walked.
class LogComparison {
 public:
  /// Whether `open` says which state the log had. Of a later version of the format that may not be readable:
  /// then nothing is said of it, and a log that does not know the case may be from before.
  enum class Head { kKnown, kUnknown };
  /// `log` may be null: then nothing is compared. It must be of a walk for this case and its `open`, and
  /// outlive the object.
  LogComparison(const LogContents* log, const std::optional<OpenEntry>& opening, FindingList& findings,
                Head head = Head::kKnown);

  /// Once, of the case's first line.
  void check_opening(const crypto::Sha256Digest& entry0);
  [[nodiscard]] bool asks_for(std::uint64_t size) const;
  /// Whether the log states a root for more entries: a checkpoint over them was made before.
  [[nodiscard]] bool knows_beyond(std::uint64_t size) const;
  /// The case's tree has `size` entries; `fits` tells whether a root is its.
  void reached(std::uint64_t size, const RootTest& fits);
  /// The case has `entries`, `close` among them or not; `tokens` are the hashes of its token files by entry.
  void finish(std::uint64_t entries, bool closed,
              const std::map<std::uint64_t, crypto::Sha256Digest>& tokens);
  /// In place of finish() where nothing but the number of entries can be read: of a later version.
  void finish_unread(std::uint64_t entries);
  /// At last, where the case's own checkpoints cover `covered` entries and it was closed by entry `close`.
  /// What the log states without a checkpoint of its own is doubted where the device signed otherwise in the
  /// case. Elsewhere nothing but the log tells of what is not there any more, and no crash leaves the log
  /// knowing more of a case than is in it: a case's checkpoint is durable before the log has its line.
  void settle(std::uint64_t covered, std::optional<std::uint64_t> close);
  /// The most entries of the case whose root the log states, and it is the case's, in an entry that the
  /// case's own device signed by that key. Of hardware only what the log had when it began to sign counts, by
  /// the root that the identity states: whoever has a copy of the other keys, and the disk, could have put
  /// other lines before the hardware.
  [[nodiscard]] EntriesBy vouched_by() const { return vouched_by_; }
  /// What the log states in entries that its device signed in time, by whichever key; nothing where no log
  /// was compared.
  [[nodiscard]] std::optional<CaseInLog> told() const;

 private:
  /// The roots that the log states for this size.
  [[nodiscard]] std::span<const KnownRoot> roots_at(std::uint64_t size) const;
  struct Doubt {
    CodeName code;
    Place place;
    std::string text;
    std::uint64_t contradicted;
  };
  static constexpr std::uint64_t kItsEnd = UINT64_MAX;

  /// Whether the log is one to compare with; else it is said why it is not.
  bool is_to_compare(const LogContents& log, bool knows);
  /// Whether the case has as many entries as the log states; else it is said.
  bool has_all(std::uint64_t entries);
  /// Of a log that says nothing for the case, nor against it.
  void add_of_another_device(std::uint64_t log_entry);
  /// That the log does not answer for the case, and why.
  void add_silent();
  /// A finding; of an entry of the log that nobody signed when it was written only in settle(). It speaks
  /// against the first `contradicted` entries of the case, or against its end.
  void add(CodeName code, const Place& place, std::uint64_t log_entry, const std::string& text,
           std::uint64_t contradicted);

  const LogContents* log_ = nullptr;
  const LoggedCase* known_ = nullptr;
  /// What a trusted device's log says of a case whose device is not trusted: another case may bear that name.
  std::optional<LogContents::OpenedByAnother> another_;
  bool unknown_ = false;    // there is a log, and it has no such case
  bool silent_ = false;     // nor does what is signed of it reach so far
  std::uint64_t head_ = 0;  // entries of the log when the case was opened
  Head known_head_ = Head::kKnown;
  std::uint64_t entries_ = 0;     // finish(): of the ledger
  std::vector<KnownRoot> roots_;  // by size, then in the order of the log
  FindingList* findings_;
  std::string case_id_, case_device_;
  bool differs_ = false, differs_in_doubt_ = false;
  EntriesBy vouched_by_;
  std::uint64_t known_entries_ = 0;
  std::vector<Doubt> doubts_;
};

}  // namespace kiroku::archive

// What a verification finds: the verdict, and what a reader of it is told (docs/reference/verdicts.md).
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/format/ledger_entry.h"
#include "archive/verify/finding.h"
#include "crypto/hash.h"
#include "crypto/witness_policy.h"
#include "timestamp/token_verifier.h"

namespace kiroku::archive {

/// kIntactExcerpt is of an excerpt alone, with or without stated gaps. An excerpt is never kIntact.
enum class Verdict { kIntact, kIntactWithGaps, kIntactExcerpt, kUnproven, kIncomplete, kTampered };
std::string_view verdict_name(Verdict verdict);  // "intact-with-gaps"
/// 0 0 4 3 3 1. `excerpt_accepted`: the caller said that an excerpt will do, so that an intact one gives 0.
int exit_status(Verdict verdict, bool excerpt_accepted = false);

/// kExternal: a token of an outside authority covers all that the case claims (all entries up to close, of an
/// excerpt its segments); kExternalInPart: one covers the beginning alone.
enum class TimeProof { kExternal, kExternalInPart, kSelfIssued, kNone };
std::string_view time_proof_name(TimeProof proof);

/// What limits the worth of a report's times, whichever TimeProof it has. Each is a finding, too; whoever
/// tells the time says it in the same breath.
enum class TimeRemark {
  kThereByThen,  // stamped-after-close: it existed by then; nothing outside says how much earlier it began
  kFirstStampedLate,  // first-stamped-late: the same of its beginning
  kEnteredLate,       // segments-entered-late: the same of film that a "not before" is told of
  kEndStampedLate,    // end-stamped-late
  kClockDiffers,      // clock-differs
  kLengthDiffers,     // close-utc-differs
};

struct StreamReport {
  StreamInfo info;
  std::uint64_t segments = 0, frames = 0, dropped = 0, bytes = 0;
  Span span;
  std::int64_t gap_ns = 0;
  std::uint64_t erased_segments = 0;  // of `segments`: entered as erased, and not there
};

/// Entries [first_entry, last_entry] were written after not_before and before not_after: by outside clocks
/// alone where the case has any token of an outside authority, else by the recorder's own authority.
/// The names are the ledger's, which says of no authority whose clock it has: `time` does. kExternal: by
/// outside authorities alone; kSelfIssued: the recorder's own takes part; kNone: neither time is there.
struct Bracket {
  std::uint64_t first_entry = 0, last_entry = 0;
  std::optional<UtcTime> not_before, not_after;
  std::string authority_before, authority_after;
  TimeProof time = TimeProof::kNone;
};

/// An authority's clock beside the case clock: gen_time, and the case clock in the middle of the exchange
/// that brought it. True time was within half_width_ns of gen_time then: half the round trip, the authority's
/// stated accuracy, and a second where gen_time has none but whole seconds.
struct ClockComparison {
  UtcTime gen_time;
  std::int64_t case_ns = 0;
  std::int64_t half_width_ns = 0;
};
/// First and last comparison of one authority, over valid tokens. The name is the ledger's: tokens under one
/// name of both kinds of authority make two clocks.
struct AuthorityClock {
  std::string authority;
  bool outside = false;
  std::uint64_t comparisons = 0;
  ClockComparison first, last;

  /// By how much the authority's clock went on more than the case clock between the two; right to
  /// drift_half_width_ns().
  [[nodiscard]] std::int64_t drift_ns() const;
  [[nodiscard]] std::int64_t drift_half_width_ns() const { return first.half_width_ns + last.half_width_ns; }
};
/// By how much gen_time is ahead of the recorder's UTC: of `clock_zero` plus the case clock.
std::int64_t offset_ns(const ClockComparison& comparison, UtcTime clock_zero);

/// Who stamped, by the trusted certificate at which the tokens' paths end. What the ledger calls it is chosen
/// by whoever writes the ledger: one may have many names.
struct StampingAuthority {
  std::string subject;  // "CN=Example TSA root,O=Example"
  bool outside = false;
  std::uint64_t tokens = 0;        // valid ones that prove time
  std::vector<std::string> names;  // in the ledger, in the order of their first tokens
};

/// A token that holds under a trusted root and proves time, by the entry that names it.
struct ProvingToken {
  std::uint64_t entry = 0;
  bool outside = false;
};

/// One stream of the case that an excerpt is of: how much of it lies in the excerpt's folder with the right
/// hash, and how much the case has.
struct ExcerptStream {
  std::string name;
  bool selected = false;
  std::uint64_t held_segments = 0, held_frames = 0;
  /// By `close`; nothing where that is not among the excerpt's lines.
  std::optional<std::uint64_t> case_segments, case_frames;
  std::uint64_t known_segments = 0;  // the case has at least so many, by the excerpt's lines
};
/// What part of a case an excerpt is.
struct ExcerptReport {
  std::int64_t from_ns = 0, to_ns = 0;      // case clock, half open; to_ns is not after the case's end
  std::int64_t begins_ns = 0;               // where the case begins on its clock
  std::uint64_t first_entry = 0, size = 0;  // the lines are those of the entries [first_entry, size)
  std::vector<ExcerptStream> streams;       // every stream of the case, in its order
  bool with_gaps = false;                   // the findings state gaps
  /// Segments of the chosen streams in its time, by its lines: those that it should hold.
  std::uint64_t listed_segments = 0;
  /// What the excerpt says of its making. Nothing proves this.
  std::optional<UtcTime> stated_made_at;
  std::string stated_made_by;
};

/// How far the segments were looked into, where identities were given. All are segments whose files have the
/// hash that the ledger states; erased ones are not there to be opened.
struct OpenedContents {
  std::uint64_t segments = 0;  // that were there
  std::uint64_t opened = 0;    // of them: decrypted to the end
  /// Of those: decoded, and found to hold as many frames as the ledger states. 0 where the program has no
  /// decoders.
  std::uint64_t decoded = 0;
  std::map<std::string, std::uint64_t> opened_of = {};  // by stream; none of which 0 were
};

/// One time-stamp of an evidence record.
struct EvidenceLink {
  std::optional<UtcTime> time;  // nothing where its token could not be read
  std::string authority;  // subject of the trusted root at which its token's path ends; empty: it does not
  bool outside = false;   // that is an outside authority's
  std::string hash;
  bool covers_data = false;  // the first one, and each hash-tree renewal; else the one before it alone
};
/// What an evidence record (RFC 4998) proves of the case.
struct EvidenceReport {
  std::string file;               // its name
  crypto::Sha256Digest sha256{};  // of the file, as it was judged
  bool holds = false;
  bool outside = false;                  // all of its time-stamps are by outside authorities
  std::optional<UtcTime> since, newest;  // of its first and its newest time-stamp
  std::optional<UtcTime> ends;           // when it must have been renewed; nothing where no end is known
  std::uint64_t time_stamps = 0;
  std::vector<EvidenceLink> links;       // the time-stamps, in their order; none where it does not hold
  std::vector<std::string> hashes;       // of its chains
  std::uint64_t entries = 0, files = 0;  // that it covers
  /// Up to which entry a later chain covers the ledger, and since when; `entries` and nothing where none
  /// covers more.
  std::uint64_t later_entries = 0;
  std::optional<UtcTime> later_since;
  std::uint64_t resealed = 0;    // segments of an excerpt that were sealed anew: it covers none
  std::string refusal;           // why it does not hold
  bool could_not_check = false;  // it was not refused: something is missing to tell
};

/// Who cosigned the log's checkpoint that holds the case's entries. The verdict is not the witnesses' matter.
struct WitnessReport {
  /// What of the case the checkpoint holds. kEnd: its end, and all before; kBeginning: its opening alone.
  enum class Holds { kNothing, kBeginning, kEnd };
  Holds holds = Holds::kNothing;
  std::string note;           // the checkpoint's name, or its proof's; empty: there is none
  std::uint64_t entries = 0;  // of the log, that it is of
  crypto::WitnessedNote witnessed;
  bool asks_for_none = false;       // the policy needs no witness
  std::vector<std::string> unused;  // why others tell nothing, a sentence each

  /// The quorum is met over the case's end, or none is asked for.
  [[nodiscard]] bool is_met() const { return asks_for_none || (holds == Holds::kEnd && witnessed.quorum); }
};
std::string_view holds_name(WitnessReport::Holds holds);  // "end"

/// By which keys of the device its checkpoints were checked. kNone: one is not signed as it must be, or none
/// covers anything. kEd25519: of all that is covered by that one
/// alone, since no other key of the device was given, or it had none yet. kBoth: by ML-DSA-65, too.
/// kHardware: by the key in the device's hardware, too. kAll: by all three.
enum class SignaturesChecked { kNone, kEd25519, kBoth, kHardware, kAll };
std::string_view signatures_name(SignaturesChecked signatures);  // "ed25519"

/// What an appliance log states of a case, in entries that its device signed in time.
struct CaseInLog {
  bool opening = false, end = false;
  /// So many of the case's first ones are those of which it states the root; of later ones it says nothing.
  std::uint64_t entries = 0;
};

/// A note of the case as it was judged: whoever shows it reads it again, and compares.
struct JudgedNote {
  std::uint64_t size = 0;                 // of the tree that it states
  crypto::Sha256Digest root{}, sha256{};  // the root; the hash of the file's bytes
};

/// Entries that nobody had signed when a recorder found its case cut off, and signed what it found. Of an
/// excerpt: over which it shows no signature from before that.
struct SignedLate {
  std::uint64_t first = 0, last = 0;
};

struct VerificationReport {
  Verdict verdict = Verdict::kTampered;
  std::string case_id;
  std::string device;  // verifier key of the case
  SignaturesChecked signatures = SignaturesChecked::kNone;
  TimeProof time = TimeProof::kNone;
  std::uint64_t signed_entries = 0;   // from 0 on: those that a checkpoint covers whose signature was checked
  std::uint64_t outside_entries = 0;  // from 0 on: those that a token of an outside authority covers
  /// How old the oldest film was when the first outside token was entered, by the case clock; only where that
  /// is more than usual (first-stamped-late).
  std::optional<std::int64_t> age_at_first_stamp_ns;
  /// By how much film ended before the outside token behind which it is entered, by the case clock, at most;
  /// only where that is more than usual (segments-entered-late).
  std::optional<std::int64_t> entered_late_ns;
  std::uint64_t entries = 0, files = 0, bytes = 0, tokens = 0, checkpoints = 0;
  /// Files of operating systems, which nobody recorded, beside those; they are not among `files` and `bytes`.
  std::uint64_t left_by_systems = 0;
  std::uint64_t outside_tokens = 0, own_tokens = 0;  // of `tokens`: valid under trusted roots, by whose
  std::vector<StreamReport> streams;                 // of an excerpt: of the selected streams, what it holds
  std::optional<ExcerptReport> excerpt;              // of an excerpt whose excerpt.json could be read
  std::vector<SignedLate> signed_late;               // in the ledger's order
  /// Segments that had no entry until then; of an excerpt those that it should hold.
  std::uint64_t found_segments = 0;
  /// Segments of an excerpt that were sealed anew. What has the hash of such a segment's entry is not its
  /// file, but the original header beside it, and the file behind its own header. Counted where it has.
  std::uint64_t rekeyed_segments = 0;
  std::uint64_t rekeyed_opened = 0;  // of them: the new header was found to yield the key of the original one
  std::optional<OpenedContents> contents;  // nothing where no identity was given
  std::optional<EvidenceReport> evidence;  // nothing where there is no record
  std::optional<WitnessReport> witnesses;  // nothing where no policy of witnesses was given
  std::vector<Bracket> brackets;
  std::vector<AuthorityClock> clocks;          // one an authority, in the order of their first tokens
  std::vector<StampingAuthority> authorities;  // in the order of their first tokens
  std::vector<ProvingToken>
      proving_tokens;  // in the ledger's order; `outside_tokens` and `own_tokens` of them
  /// What a log that was given knows of a case or an excerpt's; nothing without one, and where it was not
  /// compared.
  std::optional<CaseInLog> in_log;
  /// The checkpoint over most entries that the device signed and that is of these lines; nothing without one.
  std::optional<JudgedNote> newest_note;
  std::uint64_t proved_entries = 0;  // the first ones, that a proof of the case's end shows to be the log's
  std::vector<Finding> findings;     // ordered by entry, then file
  /// Root (RFC 6962) over the lines that were judged, of which there are `entries`; of an excerpt its opening
  /// line comes before them. Nothing where none could be read. Who shows lines beside the verdict compares
  /// it.
  std::optional<crypto::Sha256Digest> lines_root;
  std::optional<UtcTime> opened, closed;
  std::optional<std::uint64_t> close_entry;  // of a whole case
  std::optional<UtcTime> clock_zero;         // the recorder's wall clock at 0 of the case clock, by `open`
};

/// In this order, each once.
std::vector<TimeRemark> time_remarks(const VerificationReport& report);

/// Segments that the lines name and do not say are erased; of an excerpt those that it should hold.
std::uint64_t listed_segments(const VerificationReport& report);
/// Of `files`, those that lines name and whose hashes were compared with these: all but the ledger, or what
/// an excerpt has in its place, and checkpoints. `rekeyed_segments` are among them.
std::uint64_t named_files(const VerificationReport& report);

}  // namespace kiroku::archive

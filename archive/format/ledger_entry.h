// Entries of a case's ledger (docs/reference/format.md, "Ledger entries") as values, to and from their line.
// Pure functions, thread-safe.
//
// The line. One JSON object, keys in this order, no white space; a reader takes any order of keys, since the
// bytes themselves are hashed. Every key is always there unless marked "optional". Every entry begins with
//   type (text), seq (integer), utc (text), mono_ns (integer, not negative)
// and goes on with
//   open          format "kiroku-case/1", case, device, boot_id, streams [{name, kind, media, source,
//   profile,
//                 purpose, recipients [text…], timing}], subject {file, bytes, sha256} (optional), plan
//                 (optional), appliance_log {size, root}
//   segment       stream, index, file, bytes, sha256, start_ns, end_ns, first_pts, time_base, frames or
//                 samples (exactly one), dropped, complete. Of a segment that recovery found, which nobody
//                 without a key can look into, first_pts, time_base, frames or samples, and dropped are all
//                 left out, and start_ns and end_ns are estimates. profile (optional): of pictures that
//                 are archived in another form than `open` states of their stream
//   gap           stream, start_ns, end_ns, cause
//   clock         synchronised, offset_ns, error_ns, step_ns, rate_ppb (optional)
//   token         checkpoint, authority, file, sha256, gen_time, accuracy_ns, serial, asked_ns and
//   answered_ns
//                 (optional, both or none)
//   token-missed  checkpoint, authority, cause
//   mark          commitment
//   recovered     boot_id, after, truncated
//   close         reason, totals {<stream>: {segments, frames, dropped, bytes}}
//   erased        stream, first_index, last_index, policy
// Values:
//   times         RFC 3339 in UTC with exactly six decimals and Z
//   hashes        SHA-256, 64 lower-case hex digits
//   integers      plain decimal, magnitude below 2^53; counts, indexes, sizes, starts and ends not negative;
//                 end_ns >= start_ns; accuracy_ns >= 0; 0 <= asked_ns <= answered_ns; first_pts, offset_ns,
//                 step_ns and rate_ppb may be negative
//   names         of streams and authorities: [a-z0-9][a-z0-9-]{0,31}, unique among the streams
//   time_base     "<n>/<d>", decimal without leading zeros
//   serial        lower-case hex
//   texts         UTF-8, never NUL. A text that is not (an error message in `cause`) is written with U+FFFD
//                 in place of the bytes that are not.
//   appliance_log without a log: size 0 and the root of the empty tree, SHA-256 of nothing
//   totals        one member for every stream of `open`; `frames` counts samples where the segments do
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "archive/format/limits.h"
#include "base/utc_time.h"
#include "crypto/hash.h"

namespace kiroku::archive {

/// When something was written: the machine's opinion of UTC, and the case clock (nanoseconds since `open`).
struct Moment {
  UtcTime utc;
  std::int64_t mono_ns = 0;
};

/// Half-open span of the case clock.
struct Span {
  std::int64_t start_ns = 0;
  std::int64_t end_ns = 0;
};
/// Whether any of the span lies in [from_ns, to_ns); an empty span counts as its start.
bool meets(const Span& span, std::int64_t from_ns, std::int64_t to_ns);

/// One recorded stream, as `open` declares it.
struct StreamInfo {
  std::string name;                     // folder below segments/: [a-z0-9][a-z0-9-]{0,31}
  std::string kind;                     // "video", "audio", "vitals", "events"
  std::string media;                    // "video/mp2t", "video/x-matroska", "application/jsonl"
  std::string source;                   // the source as it was asked for, passwords removed
  std::string profile;                  // "mpeg2", "uncompressed", "lossless", "jsonl"
  std::string purpose;                  // free text for people: "endoscope"
  std::vector<std::string> recipients;  // "age1…"
  /// "arrival": times are when frames reached this machine. "source": a file played at its own or full speed
  /// states its own times.
  std::string timing = "arrival";
  std::string extension;  // of plaintext: "ts", "mkv", "jsonl"; derived from media, not stored
};

struct FileReference {
  std::string file;  // relative to the case folder
  std::uint64_t bytes = 0;
  crypto::Sha256Digest sha256{};
};

struct OpenEntry {
  static constexpr std::string_view kFormat = "kiroku-case/1";
  std::string case_id;
  std::string device;  // verifier key
  std::string boot_id;
  std::vector<StreamInfo> streams;
  std::optional<FileReference> subject;
  std::optional<crypto::Sha256Digest> plan;
  /// Where the case begins on its clock: after 0 if it was decided at `open` to keep what was recorded before
  /// (pre-roll). Written only then; never after the entry's own mono_ns.
  std::int64_t begins_ns = 0;
  std::uint64_t appliance_log_size = 0;
  crypto::Sha256Digest appliance_log_root{};
};

struct SegmentEntry {
  std::string stream;
  std::uint64_t index = 0;
  FileReference file;
  Span span;
  std::int64_t first_pts = 0;  // in time_base units of the stream's one muxer timeline
  std::string time_base;       // "1/90000"
  std::uint64_t frames = 0;    // frames of video; samples of vitals; lines of events
  std::uint64_t dropped = 0;
  bool counts_samples = false;  // written as `samples` instead of `frames`
  bool complete = true;
  /// False for what recovery found: only the recorder that died knew how many frames there are. Then
  /// first_pts, time_base, frames and dropped are empty and not written, and `span` is an estimate.
  bool counted = true;
  /// "mpeg2", "uncompressed" or "lossless", where it is not the stream's; "": it is, or nobody knows.
  std::string profile = {};
};

enum class GapCause {
  kSignalLost,
  kOverload,
  kDiskFull,
  kDeviceRemoved,
  kFormatChange,
  kPaused,
  kSuspended,  // the machine slept
  kInterrupted
};
std::string_view gap_cause_name(GapCause cause);  // "signal-lost"
struct GapEntry {
  std::string stream;
  Span span;
  GapCause cause = GapCause::kSignalLost;
  /// Only the sound beside the stream's pictures is missing: it says nothing of the pictures.
  bool of_sound = false;
};

struct ClockEntry {
  bool synchronised = false;
  std::int64_t offset_ns = 0, error_ns = 0, step_ns = 0;
  /// How much faster the case clock (CLOCK_BOOTTIME) ran than the machine's uncorrected crystal
  /// (CLOCK_MONOTONIC_RAW), in parts of 10^9: since the clock entry before or, where a slew begins, over the
  /// second that showed it; the entry behind that one is of the slew alone.
  std::optional<std::int64_t> rate_ppb = std::nullopt;
};
/// A rate beyond this, either way, is a slew: crystals are right to 100 ppm and the correction of that is
/// what a synchronised clock always has; a kernel that slews does so by 500 ppm (adjtime; RFC 5905's maximum
/// frequency), NTP programs by even more.
inline constexpr std::int64_t kSlewPpb = 200'000;

struct TokenEntry {
  std::uint64_t checkpoint = 0;  // tree size
  std::string authority;
  std::string file;
  crypto::Sha256Digest sha256{};
  UtcTime gen_time;
  std::int64_t accuracy_ns = 0;
  std::string serial;  // hex
  /// Case clock when the request went out and when its answer was there: gen_time lies between. Not there
  /// where the case clock stood (a token that came after its recorder had ended).
  struct Exchange {
    std::int64_t asked_ns = 0, answered_ns = 0;
  };
  std::optional<Exchange> exchange = std::nullopt;
};

struct TokenMissedEntry {
  std::uint64_t checkpoint = 0;
  std::string authority;
  std::string cause;  // one sentence
};

struct MarkEntry {
  crypto::Sha256Digest commitment{};
};

struct RecoveredEntry {
  std::string boot_id;
  std::string after;      // "power-loss", "crash"
  std::string truncated;  // one sentence, "" if nothing
};

struct StreamTotal {
  std::uint64_t segments = 0, frames = 0, dropped = 0, bytes = 0;
};
struct CloseEntry {
  std::string reason;  // "operator", "duration", "sources-ended", "disk-full", "recovered", "error: …"
  std::map<std::string, StreamTotal> totals;
};

struct ErasedEntry {
  std::string stream;
  std::uint64_t first_index = 0, last_index = 0;
  std::string policy;
};

using CaseEntryBody = std::variant<OpenEntry, SegmentEntry, GapEntry, ClockEntry, TokenEntry,
                                   TokenMissedEntry, MarkEntry, RecoveredEntry, CloseEntry, ErasedEntry>;

struct CaseEntry {
  std::uint64_t seq = 0;
  Moment at;
  CaseEntryBody body;
};

/// The value of `type`: "open", "token-missed", …
std::string_view type_of(const CaseEntryBody& body);

/// The ledger line, without LF, its keys in the order of the table below. Throws kiroku::Error for a number
/// of magnitude 2^53 or more and for a line above kMaximumLineBytes.
std::string to_line(const CaseEntry& entry);

/// What is wrong with a line, or the entry. Strict: unknown or missing keys, duplicate keys, wrong types,
/// integers of 2^53 and more, NUL, invalid UTF-8, nesting deeper than the format's, lines longer than
/// kMaximumLineBytes.
struct EntryParse {
  std::optional<CaseEntry> entry;
  std::string problem;                  // one sentence when there is no entry
  std::optional<std::size_t> position;  // byte within the line, where it is no JSON of the strict profile
};
EntryParse parse_case_entry(std::string_view line);

}  // namespace kiroku::archive

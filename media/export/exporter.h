// Plaintext out of a case's sealed segments: media re-muxed without touching a picture, vital signs as lines
// or a table. Functions; thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "archive/reading/case_reader.h"
#include "base/error.h"
#include "crypto/age_recipient.h"

namespace kiroku::media {

/// Behind the number of such lines of events.
inline constexpr const char* kLeftOutOfEvents =
    "line(s) were left out: no mark entry of the ledger commits to them, or not as often, so nothing "
    "shows that they are events of the case; "
    "'kiroku verify --identity' says more";

struct ExportOptions {
  std::string stream;
  std::int64_t from_ns = 0;
  std::int64_t to_ns = INT64_MAX;
  /// The ending decides the form:
  ///   .ts     MPEG-TS segments one after the other, nothing changed but their time stamps
  ///   .mkv    pictures and sound of any video stream, packets copied, gaps kept
  ///   .mp4    likewise, if MP4 can hold them (it holds MPEG-2, neither FFV1 nor uncompressed pictures)
  ///   .jsonl  lines of vital signs, as they were recorded, or of the case's events
  ///   .csv    vital signs as a table (vitals_table.h)
  std::filesystem::path output;
  /// The moment of the case clock that is time 0 in the file; nothing: export_zero_ns() of the stretch.
  std::optional<std::int64_t> zero_ns;
  /// Replace a file that is already there.
  bool overwrite = false;
  /// Leave out segments that retention erased, instead of refusing.
  bool pass_over_erased = false;
  /// Told of each picture in the order of the file: when it is shown, counted from time 0. From the calling
  /// thread.
  std::function<void(std::int64_t time_ns)> on_picture;
  /// Ciphertext read so far, of all that will be read. From the calling thread.
  std::function<void(std::uint64_t done_bytes, std::uint64_t total_bytes)> progress;
};
struct ExportResult {
  /// Segments read, pictures (of vital signs and events: lines) and bytes written.
  std::uint64_t segments = 0, frames = 0, bytes = 0;
  /// Segments found by recovery: what they hold is in the file and not in `frames`.
  std::uint64_t uncounted = 0;
  /// Lines that are no sample and so have no place in a table (.csv): texts, alarms, messages, notices. Of a
  /// stream of events: lines to which no `mark` entry commits, or more often than entries do.
  std::uint64_t left_out = 0;
  /// Case-clock span of what was written; whole segments, so it may be wider than asked for.
  std::int64_t start_ns = 0, end_ns = 0;
  /// The moment of the case clock that is time 0 in the file.
  std::int64_t zero_ns = 0;
  /// Segments that were being written when the power or the program failed; they end early.
  std::uint64_t incomplete = 0;
};

/// Pictures change their size or form within a stretch that is to become one .mkv or .mp4.
class FormatChanged : public Error {
 public:
  FormatChanged(const std::string& sentence, std::int64_t at_ns) : Error(sentence), at_ns_(at_ns) {}
  /// Where on the case clock: what lies before and after can be exported one by one.
  [[nodiscard]] std::int64_t at_ns() const { return at_ns_; }

 private:
  std::int64_t at_ns_;
};

/// The moment of the case clock that is time 0 of every file of a stretch, whichever stream and form: the
/// stretch's start, or that of the earliest segment of pictures or sound, of any stream, that reaches into
/// it, since whole segments are written. It follows from ledger and stretch alone, so that files which are
/// exported one by one lie on one time line. A stream that begins later begins later in its file.
std::int64_t export_zero_ns(const archive::CaseReader& recording, std::int64_t from_ns, std::int64_t to_ns);

/// Packets are copied, never re-encoded. Written beside the output and renamed when whole; nothing is left
/// behind on failure. Every segment's bytes are checked against the ledger's hash before a byte of it leaves,
/// and only the bytes that were hashed are decrypted. Throws kiroku::Error: unknown stream, nothing recorded
/// in that time, wrong identity, a segment that is not what the ledger says, a form that does not go with the
/// stream, a container that cannot hold the codec, FormatChanged, a file
/// that is already there, no space.
ExportResult export_stream(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                           const ExportOptions& options);

}  // namespace kiroku::media

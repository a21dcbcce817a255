// Plaintext out of a case's sealed segments: media re-muxed without touching a picture, vital signs as lines
// or a table. Functions; thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "archive/case_reader.h"
#include "crypto/age_recipient.h"

namespace kiroku::media {

struct ExportOptions {
  std::string stream;
  std::int64_t from_ns = 0;
  std::int64_t to_ns = INT64_MAX;
  /// The ending decides the form:
  ///   .ts     MPEG-TS segments byte for byte, one after the other
  ///   .mkv    pictures and sound of any video stream, packets copied, time from zero on, gaps kept
  ///   .mp4    likewise, if MP4 can hold them (it holds MPEG-2, neither FFV1 nor uncompressed pictures)
  ///   .jsonl  lines of vital signs or events, as they were recorded
  ///   .csv    vital signs as a table (vitals_table.h)
  std::filesystem::path output;
  /// Replace a file that is already there.
  bool overwrite = false;
  /// Ciphertext read so far, of all that will be read. From the calling thread.
  std::function<void(std::uint64_t done_bytes, std::uint64_t total_bytes)> progress;
};
struct ExportResult {
  /// Segments read, pictures (of vital signs and events: lines) and bytes written.
  std::uint64_t segments = 0, frames = 0, bytes = 0;
  /// Segments found by recovery: what they hold is in the file and not in `frames`.
  std::uint64_t uncounted = 0;
  /// Lines that are no sample and so have no place in a table (.csv): texts, alarms, messages, notices.
  std::uint64_t left_out = 0;
  /// Case-clock span of what was written; whole segments, so it may be wider than asked for.
  std::int64_t start_ns = 0, end_ns = 0;
  /// Segments that were being written when the power or the program failed; they end early.
  std::uint64_t incomplete = 0;
};

/// Packets are copied, never re-encoded. Written beside the output and renamed when whole; nothing is left
/// behind on failure. Every segment's bytes are checked against the ledger's hash before a byte of it leaves,
/// and only the bytes that were hashed are decrypted. Throws kiroku::Error: unknown stream, nothing recorded
/// in that time, wrong identity, a segment that is not what the ledger says, a form that does not go with the
/// stream, a container that cannot hold the codec, a picture size that changes within a .mkv or .mp4, a file
/// that is already there, no space.
ExportResult export_stream(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                           const ExportOptions& options);

}  // namespace kiroku::media

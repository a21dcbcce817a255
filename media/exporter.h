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
  std::filesystem::path output;  // .ts .mkv .mp4 (video), .jsonl .csv (vitals, events)
  std::function<void(std::uint64_t done_bytes, std::uint64_t total_bytes)> progress;
};
struct ExportResult {
  std::uint64_t segments = 0, frames = 0, bytes = 0;
  /// Case-clock span of what was written; whole segments, so it may be wider than asked for.
  std::int64_t start_ns = 0, end_ns = 0;
};
/// Packets are copied, never re-encoded. Written beside the output and renamed when whole. Every segment's
/// bytes are checked against the ledger's hash before a byte of it leaves. Throws kiroku::Error: unknown
/// stream, wrong identity, container that cannot hold the codec, …
ExportResult export_stream(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                           const ExportOptions& options);

}  // namespace kiroku::media

// What a case's or an excerpt's files state of themselves, read as far as they can be read: a report on a
// damaged case tells what is there. Nothing here is judged (archive/verify/verifier.h does). Functions;
// thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "archive/format/ledger_entry.h"
#include "archive/verify/report.h"
#include "crypto/hash.h"

namespace kiroku::report {

/// A signed note as it lies in the folder.
struct StoredNote {
  std::string file;  // "checkpoints/00000042.note"
  std::string text;  // its exact bytes
  std::uint64_t size = 0;
  crypto::Sha256Digest root{};
};

struct NamedFile {
  std::string name;
  crypto::Sha256Digest sha256{};
};

struct StatedToken {
  std::uint64_t entry = 0;
  archive::TokenEntry token;
};

struct CaseFacts {
  bool excerpt = false;
  NamedFile ledger;  // of an excerpt: its part of the ledger
  std::uint64_t entries = 0;
  std::optional<crypto::Sha256Digest> root;  // of all entries; not of an excerpt, which has only some
  /// The one over most entries that was judged, is signed and fits; nothing where nothing was judged.
  std::optional<StoredNote> last_checkpoint;
  std::optional<archive::OpenEntry> opening;
  std::optional<archive::Moment> opened_at, closed_at;
  std::uint64_t closed_by = 0;  // entry; of closed_at
  std::string close_reason;
  // By how much the machine's wall clock was set between them, all steps together; whether it was at all.
  std::int64_t clock_set_ns = 0;
  bool clock_set = false;
  std::vector<archive::GapEntry> gaps;
  std::vector<StatedToken> tokens;
  std::uint64_t missed_tokens = 0, marks = 0, segments = 0, segment_bytes = 0;
  // latest time of the case clock at which an entry was written or a segment ends
  std::int64_t last_ns = 0;
  /// When each entry was written, by its number; of entries that read as one.
  std::map<std::uint64_t, archive::Moment> written;
};

/// Throws kiroku::UsageError where there is no such folder or no ledger in it, kiroku::IoError. Lines that
/// are no entry are passed over.
CaseFacts read_case_facts(const std::filesystem::path& folder);
/// Of the lines that `verification` judged, so that a document states of a case what its verdict is about.
/// kiroku::Error where they, or the checkpoint over them, are no longer there; lines that were written since
/// are passed over.
CaseFacts read_case_facts(const std::filesystem::path& folder,
                          const archive::VerificationReport& verification);

}  // namespace kiroku::report

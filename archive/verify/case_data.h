// What an evidence record of a case covers (docs/reference/format-evidence.md): the first lines of the
// ledger, which a checkpoint signs, the notes of these lines, and every file that they name and that is
// there. What comes later (a late token, an erasure) is not among it until a record takes it in. Functions;
// thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/ledger_entry.h"

namespace kiroku::archive {

/// A file that an entry names; a note is named by the last entry that it covers.
struct NamedFile {
  std::string file;
  std::uint64_t entry = 0;
  /// As the entry states it; nothing of a note.
  std::optional<FileReference> stated;
};

/// Hashes of files that were taken beside SHA-256 while the files were checked: of the very bytes that had
/// the SHA-256 which their entry states.
using FileHashes = std::map<std::pair<std::string, crypto::HashAlgorithm>, Bytes>;

struct CaseData {
  std::string case_id;
  std::uint64_t lines = 0;                // of the ledger, whole ones
  crypto::Sha256Digest root{};            // RFC 6962, over these lines
  std::optional<std::uint64_t> close;     // the entry
  std::vector<std::uint64_t> note_sizes;  // of the notes that are there, rising; none beyond the ledger
  std::vector<NamedFile> files;           // that are there, in the order of their entries
};
/// What the ledger's first line says. Throws kiroku::Error where it cannot be read, or is no whole `open`.
std::string read_case_id(const CaseFolder& folder);
/// Throws kiroku::Error where the ledger cannot be read, or has no whole `open`.
CaseData read_case_data(const CaseFolder& folder);

/// Hashes of the ledger's first lines: of as many as each of `sizes` says, which rises and ends within the
/// ledger. Throws kiroku::Error, kiroku::IoError.
std::map<std::uint64_t, Bytes> hash_ledger_at(const CaseFolder& folder,
                                              const std::vector<std::uint64_t>& sizes,
                                              crypto::HashAlgorithm algorithm);

/// The hash of a file, read from front to end, and compared with what its entry states. Throws kiroku::Error
/// where it cannot be read, or is another.
Bytes hash_named_file(const CaseFolder& folder, const NamedFile& file, crypto::HashAlgorithm algorithm);

/// "ledger.jsonl, the first 42 lines".
std::string words_of_lines(std::uint64_t size);

/// Where the record of a case lies: evidence/<case>.ers beside its folder.
std::filesystem::path evidence_file(const std::filesystem::path& case_folder, const std::string& case_id);

}  // namespace kiroku::archive

// What a recorder that died left in a case's folder without an entry in its ledger. Symbolic links and
// special files are never among it. Functions; thread-safe for different cases.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/ledger_entry.h"
#include "evidence/shared_token.h"
#include "timestamp/token_verifier.h"

namespace kiroku::archive {

class FileSystem;

/// Of so many segment files of a stream that no entry names recovery takes notice. A recorder holds 16 sealed
/// ones that wait for the disk, and those whose entry is being written. A film that is read as fast as it
/// goes leaves more.
inline constexpr std::size_t kMostFoundSegments = 64, kMostFoundOfFilms = 256;
/// So many tokens that no entry names are judged of a case, the newest ones.
inline constexpr std::size_t kMostFoundTokens = 64;

struct FoundSegment {
  std::uint64_t index = 0;
  bool complete = false;  // it has its final name, so it was sealed to its end and durable
  std::filesystem::path path;
  UtcTime last_change;  // of the file's contents, by the wall clock
  std::string whole;    // in the case, as it is called once it is complete
};
/// Segment files of the stream from `first_index` on, in order; those with a final name before parts.
/// Throws kiroku::IoError.
std::vector<FoundSegment> found_segments(const FileReading& files, const std::filesystem::path& case_folder,
                                         const StreamInfo& stream, std::uint64_t first_index);
/// Of token files that no entry names those that are looked into: where there are more than kMostFoundTokens,
/// the newest so many of checkpoints that are there. `left` counts the others. Throws kiroku::IoError.
std::vector<TokenName> tokens_to_judge(std::vector<TokenName> found, const std::filesystem::path& case_folder,
                                       const FileReading& files, std::size_t& left);
/// All token files, by checkpoint, then authority, then form. Throws kiroku::IoError.
std::vector<TokenName> found_tokens(const std::filesystem::path& case_folder,
                                    const FileReading& files = real_reading());

/// How a token's file of that form is to be judged as one over the note; nothing, and why, for what is not of
/// that form. Of a response that shows when it is judged.
std::optional<evidence::StampJudging> judging_of(TokenForm form, ByteView file, ByteView note,
                                                 std::string& explanation);
/// gen_time, accuracy_ns and serial of a token file, which may have no entry yet; nothing if it is not over
/// that checkpoint's note, or one of the two is not there, or if it is not valid under `trust`. Where that is
/// null nothing is trusted here. Throws kiroku::Error where one of the two is there and cannot be read.
std::optional<TokenEntry> token_in_folder(const CaseFolder& folder, const TokenName& name,
                                          const timestamp::TrustStore* trust = nullptr);

/// What stands in a part, as far as that can be told without a key. After a power cut its length proves
/// nothing: of what was not flushed, some blocks are zeros.
struct PartContents {
  bool holds_sealed_bytes = false;  // anything behind an age header and its nonce, or behind zeros
  std::uint64_t zeros_at_end = 0;   // bytes
};
/// Throws kiroku::IoError, kiroku::Error where the file cannot be read to its end.
PartContents look_into(const FileReading& files, const std::filesystem::path& part);
/// Whether a file has the form of a segment of the stream that was sealed to its end, when nobody counted
/// what is in it: of pictures there is something, and of lines there may have been none. Throws
/// kiroku::IoError.
bool may_be_found_complete(const crypto::ByteSource& file, const StreamInfo& stream);
/// Whether the entry is of a segment that was cut off and that recovery found: nobody knew what was in it
/// when it was entered, so what does not open of it was lost before.
bool was_found_cut_off(const SegmentEntry& segment);

/// Size of the newest checkpoint's note in a case's or log's folder, by its name; 0 if there is none. Throws
/// kiroku::IoError.
std::uint64_t newest_note(const std::filesystem::path& folder, const FileReading& files = real_reading());

/// Flushes a file and its folder, and measures what the disk then gives back, past the page cache: after a
/// flush that failed unseen, the cache may hold what the disk does not. `file` of the result is empty. Throws
/// what measure_file() throws.
FileReference make_durable(FileSystem& files, const std::filesystem::path& file);
/// Size and SHA-256 of a file; `file` of the result is empty. Throws kiroku::IoError, kiroku::Error where the
/// file cannot be read to its end.
FileReference measure_file(const FileReading& files, const std::filesystem::path& file);
/// Removes what was not written to its end of checkpoints, tokens and certificates: nothing names it, and
/// all of it can be made anew. Throws kiroku::IoError.
void remove_unfinished_files(FileSystem& files, const std::filesystem::path& case_folder);

}  // namespace kiroku::archive

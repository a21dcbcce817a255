#include "archive/reading/replica.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/line_reader.h"
#include "archive/format/sealed_file.h"
#include "archive/reading/case_reader.h"
#include "archive/verify/excerpt_verifier.h"
#include "base/error.h"
#include "crypto/hash.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBlockBytes = 1U << 20U;

/// Whether `close` is among the whole lines within the first `bytes` of the ledger.
bool closes_within(const ReadableFile& ledger, std::uint64_t bytes) {
  LineReader reader(ledger);
  LedgerLine line;
  std::uint64_t end = 0;
  while (reader.next(line) && !line.torn) {
    end += line.text.size() + 1;
    if (line.too_long || end > bytes) {
      return false;
    }
    const EntryParse parse = parse_case_entry(line.text);
    if (parse.entry && std::holds_alternative<CloseEntry>(parse.entry->body)) {
      return true;
    }
  }
  return false;
}

/// The first reason why the replica's ledger is not the case's, as far as it goes.
std::optional<std::string> ledger_problem(const CaseFolder& original, const CaseFolder& copy) {
  const FileOpening ours = original.open_file(kLedgerFile);
  if (!ours.file) {
    throw Error((original.path() / kLedgerFile).string() + " " + ours.explanation);
  }
  const FileOpening theirs = copy.open_file(kLedgerFile);
  if (is_excerpt(copy)) {
    return "it is an excerpt, which is no copy of the case";
  }
  if (!theirs.file) {
    return "its ledger " + theirs.explanation;
  }
  Bytes block(kBlockBytes), other(kBlockBytes);
  for (std::uint64_t at = 0; at < theirs.file->size();) {
    const std::size_t got = theirs.file->read_at(at, other);
    const std::size_t have = ours.file->read_at(at, std::span(block).first(got));
    if (have < got ||
        !std::equal(other.begin(), other.begin() + static_cast<std::ptrdiff_t>(got), block.begin())) {
      return "its ledger is another one";
    }
    if (got == 0) {
      break;
    }
    at += got;
  }
  return closes_within(*ours.file, theirs.file->size())
             ? std::nullopt
             : std::optional<std::string>("its ledger is not closed yet");
}

std::optional<std::string> segment_problem(const CaseFolder& copy, const SegmentEntry& segment) {
  const FileReference& stated = segment.file;
  const FileOpening opening = copy.open_file(stated.file);
  if (!opening.file) {
    return stated.file + " " + opening.explanation;
  }
  if (const auto why = why_not_sealed(*opening.file, segment)) {
    return stated.file + " is not the one that was recorded: it " + *why;
  }
  crypto::Sha256 hash;
  Bytes block(kBlockBytes);
  std::uint64_t at = 0;
  while (const std::size_t got = opening.file->read_at(at, block)) {
    hash.update(ByteView(block).first(got));
    at += got;
  }
  if (at != stated.bytes || hash.finish() != stated.sha256) {
    return stated.file + " is not the one that was recorded";
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::string> why_not_replicated(const fs::path& case_folder, const std::string& stream,
                                              const fs::path& replica) {
  if (!fs::is_directory(replica)) {
    return "there is no copy of the case";
  }
  // A link, or a second mount, that leads back to the case is no second copy.
  const fs::path segments = fs::path(kSegmentsFolder) / stream;
  std::error_code missing;
  if (fs::equivalent(case_folder, replica, missing) ||
      fs::equivalent(case_folder / segments, replica / segments, missing)) {
    return "it is the case itself";
  }
  try {
    const CaseFolder copy = CaseFolder::open(replica);
    if (auto problem = ledger_problem(CaseFolder::open(case_folder), copy)) {
      return problem;
    }
    const CaseReader reader = CaseReader::open(case_folder);
    std::vector<ErasedEntry> erased;
    reader.for_each([&](const CaseEntry& entry) {
      if (const auto* gone = std::get_if<ErasedEntry>(&entry.body)) {
        erased.push_back(*gone);
      }
    });
    for (const SegmentEntry& segment : reader.segments(stream, INT64_MIN, INT64_MAX)) {
      const bool gone = std::any_of(erased.begin(), erased.end(), [&](const ErasedEntry& each) {
        return each.stream == stream && each.first_index <= segment.index && segment.index <= each.last_index;
      });
      if (gone) {
        continue;
      }
      if (auto problem = segment_problem(copy, segment)) {
        return problem;
      }
    }
  } catch (const IoError& error) {
    // A copy that cannot be read now is none; a case that cannot be read is not erased from either.
    return std::string(error.what());
  }
  return std::nullopt;
}

}  // namespace kiroku::archive

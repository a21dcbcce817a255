#include "archive/verify/case_data.h"

#include <algorithm>
#include <set>

#include "archive/format/case_layout.h"
#include "archive/format/limits.h"
#include "archive/format/line_reader.h"
#include "archive/verify/checkpoint_rules.h"
#include "base/error.h"
#include "crypto/merkle_tree.h"

namespace kiroku::archive {

namespace {

constexpr std::size_t kBytesAtOnce = 1U << 20U;

ReadableFile open_named(const CaseFolder& folder, const std::string& file) {
  FileOpening opening = folder.open_file(file);
  if (!opening.file) {
    throw Error((folder.path() / file).string() + " " + opening.explanation);
  }
  return std::move(*opening.file);
}

/// Hands the file's bytes over, from front to end.
template <typename Take>
void read_through(const ReadableFile& file, const Take& take) {
  file.expect_sequential_reading();
  std::vector<std::byte> buffer(kBytesAtOnce);
  std::uint64_t read = 0;
  while (const std::size_t count = file.read_at(read, buffer)) {
    take(ByteView(buffer).first(count));
    read += count;
  }
  file.require_read_to_end(read);
}

const FileReference* file_named_by(const CaseEntryBody& body, FileReference& made) {
  if (const auto* open = std::get_if<OpenEntry>(&body)) return open->subject ? &*open->subject : nullptr;
  if (const auto* segment = std::get_if<SegmentEntry>(&body)) return &segment->file;
  if (const auto* token = std::get_if<TokenEntry>(&body)) {
    made = {token->file, 0, token->sha256};
    return &made;
  }
  return nullptr;
}

[[noreturn]] void refuse_ledger(const CaseFolder& folder) {
  throw Error((folder.path() / kLedgerFile).string() + " does not begin with the opening of a case");
}

}  // namespace

std::string read_case_id(const CaseFolder& folder) {
  const ReadableFile ledger = open_named(folder, std::string(kLedgerFile));
  LineReader reader(ledger);
  LedgerLine line;
  if (!reader.next(line) || line.torn || line.too_long) refuse_ledger(folder);
  const EntryParse parse = parse_case_entry(line.text);
  const auto* open = parse.entry ? std::get_if<OpenEntry>(&parse.entry->body) : nullptr;
  if (open == nullptr) refuse_ledger(folder);
  return open->case_id;
}

CaseData read_case_data(const CaseFolder& folder) {
  CaseData data;
  std::set<std::string> there;
  const std::vector<ListedFile> listing = folder.list();
  for (const ListedFile& file : listing) {
    if (file.kind == ListedFile::Kind::kRegular) there.insert(file.path);
  }
  const ReadableFile ledger = open_named(folder, std::string(kLedgerFile));
  LineReader reader(ledger);
  LedgerLine line;
  crypto::MerkleFrontier tree;
  while (reader.next(line) && !line.torn) {
    const std::uint64_t lines = tree.size();
    const EntryParse parse = line.too_long ? EntryParse{} : parse_case_entry(line.text);
    if (lines == 0) {
      const auto* open = parse.entry ? std::get_if<OpenEntry>(&parse.entry->body) : nullptr;
      if (open == nullptr) break;
      data.case_id = open->case_id;
    }
    FileReference made;
    const FileReference* file = parse.entry ? file_named_by(parse.entry->body, made) : nullptr;
    if (file != nullptr && there.contains(file->file)) data.files.push_back({file->file, lines, *file});
    if (parse.entry && std::holds_alternative<CloseEntry>(parse.entry->body)) data.close = lines;
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
  }
  data.lines = tree.size();
  data.root = tree.root();
  if (data.lines == 0) refuse_ledger(folder);
  for (const std::uint64_t size : note_sizes(listing)) {
    if (size == 0 || size > data.lines) continue;
    data.note_sizes.push_back(size);
    data.files.push_back({note_path(size), size - 1, std::nullopt});
  }
  std::ranges::stable_sort(data.files, {}, &NamedFile::entry);
  return data;
}

std::map<std::uint64_t, Bytes> hash_ledger_at(const CaseFolder& folder,
                                              const std::vector<std::uint64_t>& sizes,
                                              crypto::HashAlgorithm algorithm) {
  std::map<std::uint64_t, Bytes> hashes;
  auto wanted = sizes.begin();
  crypto::Hasher hasher(algorithm);
  std::uint64_t lines = 0;
  read_through(open_named(folder, std::string(kLedgerFile)), [&](ByteView bytes) {
    while (!bytes.empty() && wanted != sizes.end()) {
      const auto feed = std::find(bytes.begin(), bytes.end(), std::byte{'\n'});
      const auto length = static_cast<std::size_t>(feed - bytes.begin()) + (feed != bytes.end() ? 1U : 0U);
      hasher.update(bytes.first(length));
      lines += feed != bytes.end() ? 1U : 0U;
      if (feed != bytes.end() && lines == *wanted) hashes.emplace(*wanted++, hasher.so_far());
      bytes = bytes.subspan(length);
    }
  });
  if (wanted != sizes.end()) {
    throw Error((folder.path() / kLedgerFile).string() + " has fewer than " + std::to_string(*wanted) +
                " lines");
  }
  return hashes;
}

Bytes hash_named_file(const CaseFolder& folder, const NamedFile& named, crypto::HashAlgorithm algorithm) {
  const ReadableFile file = open_named(folder, named.file);
  crypto::Hasher hasher(algorithm);
  crypto::Sha256 stated;
  read_through(file, [&](ByteView bytes) {
    hasher.update(bytes);
    if (named.stated) stated.update(bytes);
  });
  if (named.stated && stated.finish() != named.stated->sha256) {
    throw Error(file.path().string() + " has not the hash that entry " + std::to_string(named.entry) +
                " of its ledger states");
  }
  return hasher.so_far();
}

std::string words_of_lines(std::uint64_t size) {
  return std::string(kLedgerFile) + ", the first " + std::to_string(size) + (size == 1 ? " line" : " lines");
}

std::filesystem::path evidence_file(const std::filesystem::path& case_folder, const std::string& case_id) {
  const std::filesystem::path normal = std::filesystem::absolute(case_folder).lexically_normal();
  const std::filesystem::path folder = normal.has_filename() ? normal : normal.parent_path();
  return folder.parent_path() / kEvidenceFolder / (case_id + ".ers");
}

}  // namespace kiroku::archive

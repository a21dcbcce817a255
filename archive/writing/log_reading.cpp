#include "archive/writing/log_reading.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/line_reader.h"
#include "archive/format/log_entry.h"
#include "archive/storage/file_system.h"
#include "archive/writing/own_checkpoints.h"
#include "base/error.h"
#include "crypto/merkle_tree.h"

namespace kiroku::archive {

namespace fs = std::filesystem;

namespace {

/// `damaged` is told why a line cannot be read.
void visit_log_lines(const fs::path& folder, const std::function<void(const LogLine&)>& visit,
                     const std::function<void(const std::string&)>& damaged) {
  const fs::path file = folder / kLedgerFile;
  std::error_code missing;
  const bool is_folder = fs::is_directory(folder, missing);
  const FileOpening opening = is_folder ? CaseFolder::open(folder).open_file(kLedgerFile) : FileOpening{};
  if (!opening.file) {
    throw UsageError("there is no appliance log in " + folder.string() +
                     ": give the folder that holds its ledger.jsonl");
  }
  LineReader reader(*opening.file);
  std::uint64_t number = 0;
  // A last line without LF was torn by a power cut, or another process is writing it just now.
  for (LedgerLine line; reader.next(line) && !line.torn;) {
    ++number;
    const LogEntryParse parsed =
        line.too_long ? LogEntryParse{std::nullopt, "it is too long"} : parse_log_entry(line.text);
    if (!parsed.entry) {
      damaged("cannot read line " + std::to_string(number) + " of " + file.string() + ": " + parsed.problem);
      continue;
    }
    visit(
        {number - 1, parsed.entry->at.utc, std::string(type_of(parsed.entry->body)), std::string(line.text)});
  }
}

}  // namespace

void for_each_log_line(const fs::path& folder, const std::function<void(const LogLine&)>& visit) {
  visit_log_lines(folder, visit, [](const std::string& why) { throw Error(why); });
}

std::string for_each_readable_log_line(const fs::path& folder,
                                       const std::function<void(const LogLine&)>& visit) {
  std::string first;
  visit_log_lines(folder, visit, [&first](const std::string& why) {
    if (first.empty()) {
      first = why;
    }
  });
  return first;
}

bool is_signed_entry(const fs::path& folder, const crypto::VerifierKey& device, std::uint64_t seq,
                     const crypto::Sha256Digest& root) {
  const std::optional<OwnCheckpoint> own = checkpoint_of(folder, device, seq + 1, real_reading());
  return own && own->checkpoint.root == root;
}

crypto::Sha256Digest root_of_log(const fs::path& folder, std::uint64_t size) {
  crypto::MerkleFrontier tree;
  for_each_log_line(folder, [&](const LogLine& line) {
    if (tree.size() < size) tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
  });
  if (tree.size() < size) {
    throw Error("the appliance log in " + folder.string() + " has " + std::to_string(tree.size()) +
                " entries where at least " + std::to_string(size) + " were asked for");
  }
  return tree.root();
}

std::uint64_t newest_signed_size(const fs::path& folder, const crypto::VerifierKey& device) {
  const std::vector<std::uint64_t> sizes = note_sizes_in(real_reading(), folder);
  for (auto size = sizes.rbegin(); size != sizes.rend(); ++size) {
    if (checkpoint_of(folder, device, *size, real_reading())) return *size;
  }
  return 0;
}

std::optional<DamageClaim> first_that_stands(const fs::path& folder, const crypto::VerifierKey& device,
                                             std::span<const DamageClaim> claims) {
  if (claims.empty()) return std::nullopt;
  const FileReading& files = real_reading();
  std::vector<std::uint64_t> sizes = note_sizes_in(files, folder);
  std::erase_if(sizes, [&](std::uint64_t size) { return size > claims.back().entry; });
  const std::vector<crypto::Sha256Digest> roots = roots_of_lines(files, folder / kLedgerFile, sizes);
  // Of those before the next claim the ones that may fit still: each note is opened once, and what does not
  // fit is never asked again. Whoever makes thousands of claims and notes makes nobody look at each pair.
  struct Candidate {
    std::size_t at = 0;
    bool fits = false;
  };
  std::vector<Candidate> before;
  std::size_t next = 0;
  for (const DamageClaim& claim : claims) {
    for (; next < roots.size() && sizes[next] <= claim.entry; ++next) before.push_back({next, false});
    bool refuted = false;
    while (!refuted && !before.empty() && sizes[before.back().at] >= claim.size) {
      Candidate& newest = before.back();
      newest.fits = newest.fits ||
                    checkpoint_of(folder, device, sizes[newest.at], files, &roots[newest.at]).has_value();
      refuted = newest.fits;
      if (!refuted) before.pop_back();
    }
    if (!refuted) return claim;
  }
  return std::nullopt;
}

std::vector<LogLine> read_log(const fs::path& folder) {
  std::vector<LogLine> lines;
  for_each_log_line(folder, [&](const LogLine& line) { lines.push_back(line); });
  return lines;
}

}  // namespace kiroku::archive

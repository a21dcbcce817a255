#include "archive/case_against_log.h"

#include <cstdint>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "archive/case_folder.h"
#include "archive/case_layout.h"
#include "archive/ledger_entry.h"
#include "archive/line_reader.h"
#include "archive/log_entry.h"
#include "base/error.h"
#include "crypto/merkle_tree.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

/// What a log states of one case.
struct Stated {
  std::optional<crypto::Sha256Digest> opening_line;
  bool opening_signed = false;
  std::multimap<std::uint64_t, crypto::Sha256Digest> roots;  // by size
};

void for_each_whole_line(const fs::path& folder, const std::function<void(std::string_view)>& visit) {
  const FileOpening ledger = CaseFolder::open(folder).open_file(kLedgerFile);
  if (!ledger.file) {
    throw Error("cannot read " + (folder / kLedgerFile).string() + ": it " + ledger.explanation);
  }
  LineReader reader(*ledger.file);
  for (LedgerLine line; reader.next(line) && !line.torn;) {
    visit(line.text);
  }
}

/// Whether there is a note of this size in the folder, signed by `device` of just this.
bool is_signed(const fs::path& folder, const crypto::Checkpoint& wanted, const crypto::VerifierKey& device) {
  const FileOpening file = CaseFolder::open(folder).open_file(note_path(wanted.size));
  const std::optional<std::string> note =
      file.file ? read_small(*file.file, kMaximumNoteBytes) : std::nullopt;
  if (!note) {
    return false;
  }
  const crypto::OpenedNote opened = crypto::open_note(*note, {device});
  return !opened.failure && crypto::Checkpoint::parse(opened.text) == wanted;
}

/// Whether a recovery writes such entries: it counts nothing, and marks nothing. `close` and `erased` are cut
/// off where nobody signed them, and tokens are nothing without a checkpoint.
bool may_be_of_recovery(const CaseEntryBody& body) {
  if (const auto* segment = std::get_if<SegmentEntry>(&body)) {
    return !segment->counted;
  }
  return !std::holds_alternative<OpenEntry>(body) && !std::holds_alternative<MarkEntry>(body) &&
         !std::holds_alternative<ClockEntry>(body);
}

/// Lines that are no entries are the verifier's to find.
Stated stated_of(const std::string& case_id, const fs::path& log_folder, const crypto::VerifierKey& device) {
  Stated stated;
  crypto::MerkleFrontier tree;
  for_each_whole_line(log_folder, [&](std::string_view line) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    if (line.find(case_id) == std::string_view::npos) {
      return;
    }
    const LogEntryParse parse = parse_log_entry(line);
    if (!parse.entry) {
      return;
    }
    if (const auto* opened = std::get_if<CaseOpenedEntry>(&parse.entry->body);
        opened != nullptr && opened->case_id == case_id && !stated.opening_line) {
      stated.opening_line = opened->sha256;
      stated.opening_signed =
          is_signed(log_folder, {log_origin(device.name()), tree.size(), tree.root()}, device);
    } else if (const auto* checkpoint = std::get_if<CaseCheckpointEntry>(&parse.entry->body);
               checkpoint != nullptr && checkpoint->case_id == case_id) {
      stated.roots.emplace(checkpoint->size, checkpoint->root);
    } else if (const auto* closed = std::get_if<CaseClosedEntry>(&parse.entry->body);
               closed != nullptr && closed->case_id == case_id) {
      stated.roots.emplace(closed->size, closed->root);
    }
  });
  return stated;
}

}  // namespace

std::optional<std::string> why_not_the_logged_case(const fs::path& case_folder, const fs::path& log_folder,
                                                   const crypto::VerifierKey& device) {
  const Stated stated = stated_of(case_folder.filename().string(), log_folder, device);
  std::optional<std::string> problem;
  bool recorded = false;  // on from an opening that nobody signed in time
  crypto::MerkleFrontier tree;
  for_each_whole_line(case_folder, [&](std::string_view line) {
    if (tree.size() > 0 && stated.opening_line && !stated.opening_signed && !recorded) {
      const EntryParse parse = parse_case_entry(line);
      const bool begins = tree.size() == 1;  // a recovery does, with `recovered`
      recorded = !parse.entry || !may_be_of_recovery(parse.entry->body) ||
                 (begins && !std::holds_alternative<RecoveredEntry>(parse.entry->body));
    }
    if (tree.size() == 0 && stated.opening_line && crypto::sha256(bytes_of(line)) != *stated.opening_line) {
      problem = problem.value_or("the appliance log knows another first entry of it");
    }
    tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    const auto [first, end] = stated.roots.equal_range(tree.size());
    for (auto each = first; each != end && !problem; ++each) {
      if (each->second != tree.root()) {
        problem = "the first " + std::to_string(tree.size()) +
                  " entries are not those whose root the appliance log states";
      }
    }
  });
  if (!problem && !stated.roots.empty() && stated.roots.rbegin()->first > tree.size()) {
    problem = "the appliance log knows " + std::to_string(stated.roots.rbegin()->first) +
              " entries of it and there are " + std::to_string(tree.size());
  }
  if (!problem && recorded) {
    problem = "nobody signed in the appliance log that it was opened, before another line followed there";
  }
  return problem;
}

}  // namespace kiroku::archive

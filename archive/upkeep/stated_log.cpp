#include "archive/upkeep/stated_log.h"

#include <algorithm>
#include <map>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/line_reader.h"
#include "archive/reading/case_reader.h"
#include "archive/verify/found_files.h"
#include "archive/writing/appliance_log.h"
#include "base/error.h"
#include "crypto/merkle_tree.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

[[noreturn]] void throw_unknown(const StatedQuestion& question, const fs::path& log_folder,
                                const std::string& why) {
  throw Error("nobody can tell " + question.what + ": the appliance log in " + log_folder.string() + " " +
              why + "; 'kiroku log --verify' says more");
}

/// Whether a case lies beside the log's place whose first line says that a log was there.
bool has_case_with_log(const fs::path& archive) {
  std::error_code ignored;
  for (const fs::directory_entry& each : fs::directory_iterator(archive, ignored)) {
    if (!is_case_id(each.path().filename().string())) continue;
    try {
      if (CaseReader::open(each.path()).opening().appliance_log_size > 0) return true;
    } catch (const Error&) {
      return true;  // what cannot be read cannot say that there was none
    }
  }
  return false;
}

/// What the device's cases in the archive state of its log: of each size the root, and a case that says so.
/// Whoever cuts the log back would have to take these cases away, too.
std::map<std::uint64_t, std::pair<crypto::Sha256Digest, std::string>> stated_by_cases(
    const fs::path& archive, const crypto::VerifierKey& device) {
  std::map<std::uint64_t, std::pair<crypto::Sha256Digest, std::string>> stated;
  std::error_code ignored;
  for (const fs::directory_entry& each : fs::directory_iterator(archive, ignored)) {
    const std::string name = each.path().filename().string();
    if (!is_case_id(name)) continue;
    try {
      // What is no ledger of this device says nothing of its log; verification of the case tells more.
      const FileOpening ledger = CaseFolder::open(each.path()).open_file(kLedgerFile);
      if (!ledger.file) continue;
      LineReader reader(*ledger.file);
      LedgerLine line;
      if (!reader.next(line) || line.torn || line.too_long) continue;
      const EntryParse first = parse_case_entry(line.text);
      const auto* const open = first.entry ? std::get_if<OpenEntry>(&first.entry->body) : nullptr;
      if (open == nullptr || open->case_id != name || crypto::VerifierKey::parse(open->device) != device)
        continue;
      stated.try_emplace(open->appliance_log_size, open->appliance_log_root, name);
    } catch (const Error&) {
      continue;
    }
  }
  return stated;
}

}  // namespace

void read_stated(const fs::path& log_folder, const crypto::VerifierKey& device,
                 const std::optional<crypto::Checkpoint>& seen, const StatedQuestion& question) {
  if (std::error_code ignored; !fs::exists(log_folder / kLedgerFile, ignored)) {
    if (has_case_with_log(log_folder.parent_path())) {
      throw_unknown(question, log_folder,
                    "is not there, though cases are that were recorded beside it: put it back");
    }
    return;
  }
  // Before the lines are read: another process may add lines and checkpoints, and open cases, meanwhile.
  const std::uint64_t newest = newest_note(log_folder);
  const auto by_cases = stated_by_cases(log_folder.parent_path(), device);
  auto next_by_case = by_cases.begin();
  std::optional<std::string> contradicted_by;
  crypto::MerkleFrontier tree;
  std::optional<crypto::Sha256Digest> root_at_newest, root_at_seen;
  bool only_starts = true;
  for_each_log_line(log_folder, [&](const LogLine& line) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
    if (tree.size() == newest) {
      root_at_newest = tree.root();
    }
    if (seen && tree.size() == seen->size) {
      root_at_seen = tree.root();
    }
    for (; next_by_case != by_cases.end() && next_by_case->first <= tree.size(); ++next_by_case) {
      const auto& [size, stated] = *next_by_case;
      if (size == tree.size() && stated.first != tree.root() && !contradicted_by)
        contradicted_by = stated.second;
    }
    only_starts = only_starts && (line.type == "boot" || line.type == "config-changed");
    if (std::ranges::find(question.types, line.type) == question.types.end()) {
      return;
    }
    const LogEntry entry = parse_log_entry(line.json).entry.value();
    // By no key that the log names instead: whoever can write to the disk adds a start of the machine that
    // names theirs, and the recorder's next entry signs over it.
    question.visit(
        {entry, line.seq, [&] { return is_signed_entry(log_folder, device, line.seq, tree.root()); }});
  });
  if (newest > tree.size()) {
    throw_unknown(question, log_folder,
                  "has " + std::to_string(tree.size()) + " entries where one was signed over " +
                      std::to_string(newest));
  }
  if (next_by_case != by_cases.end()) contradicted_by = by_cases.rbegin()->second.second;
  if (contradicted_by) {
    throw_unknown(question, log_folder,
                  "does not go on from the entries that it had when case " + *contradicted_by +
                      " was opened: its end was removed, or it was rewritten");
  }
  if (newest == 0 && !only_starts) {
    throw_unknown(question, log_folder, "has no checkpoint");
  }
  if (seen && seen->size > 0 && root_at_seen != seen->root) {
    throw_unknown(question, log_folder,
                  "does not go on from the " + std::to_string(seen->size) +
                      " entries that witnesses saw: its end was removed, or it was rewritten");
  }
  if (newest > 0 && !is_signed_entry(log_folder, device, newest - 1, root_at_newest.value())) {
    throw_unknown(question, log_folder,
                  "does not fit its newest checkpoint, or that is not signed by " + device.name());
  }
}

}  // namespace kiroku::archive

#include "archive/upkeep/stated_log.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/line_reader.h"
#include "archive/format/log_entry.h"
#include "archive/reading/case_reader.h"
#include "archive/writing/log_reading.h"
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

/// The archive in which a log lies, however its folder was named.
fs::path archive_of(const fs::path& log_folder) {
  fs::path log = fs::weakly_canonical(fs::absolute(log_folder));
  if (!log.has_filename()) log = log.parent_path();  // named with a '/' at its end
  return log.parent_path();
}

/// Throws kiroku::IoError where the archive cannot be listed: then nobody knows which cases there are.
std::vector<std::string> cases_in(const fs::path& archive) {
  if (!real_reading().exists(archive)) return {};
  std::vector<std::string> names = real_reading().names_in(archive);
  std::erase_if(names, [](const std::string& name) { return !is_case_id(name); });
  return names;
}

/// Whether a case lies beside the log's place whose first line says that a log was there.
bool has_case_with_log(const fs::path& archive) {
  return std::ranges::any_of(cases_in(archive), [&](const std::string& name) {
    try {
      return CaseReader::open(archive / name).opening().appliance_log_size > 0;
    } catch (const Error&) {
      return true;  // what cannot be read cannot say that there was none
    }
  });
}

/// What a case says of the log that it was recorded beside.
struct StatedByCase {
  std::uint64_t size = 0;
  crypto::Sha256Digest root{};
  std::string case_id;
};

/// What the device's cases in the archive state of its log, by size. Whoever cuts the log back would have to
/// take these cases away, too. Two that state one size may differ: then one of them was made up, and each
/// counts.
std::vector<StatedByCase> stated_by_cases(const fs::path& archive, const crypto::VerifierKey& device) {
  std::vector<StatedByCase> stated;
  for (const std::string& name : cases_in(archive)) {
    try {
      // What is no ledger of this device says nothing of its log; verification of the case tells more.
      const FileOpening ledger = CaseFolder::open(archive / name).open_file(kLedgerFile);
      const std::optional<std::string> line = ledger.file ? first_whole_line(*ledger.file) : std::nullopt;
      if (!line) continue;
      const EntryParse first = parse_case_entry(*line);
      const auto* const open = first.entry ? std::get_if<OpenEntry>(&first.entry->body) : nullptr;
      if (open == nullptr || open->case_id != name || crypto::VerifierKey::parse(open->device) != device)
        continue;
      // Every log goes on from none.
      if (open->appliance_log_size == 0) continue;
      stated.push_back({open->appliance_log_size, open->appliance_log_root, name});
    } catch (const Error&) {
      continue;
    }
  }
  std::ranges::sort(stated, {}, &StatedByCase::size);
  return stated;
}

}  // namespace

void read_stated(const fs::path& log_folder, const crypto::VerifierKey& device,
                 const std::optional<crypto::Checkpoint>& seen, const StatedQuestion& question) {
  if (std::error_code ignored; !fs::exists(log_folder / kLedgerFile, ignored)) {
    if (has_case_with_log(archive_of(log_folder))) {
      throw_unknown(question, log_folder,
                    "is not there, though cases are that were recorded beside it: put it back");
    }
    return;
  }
  // Before the lines are read: another process may add lines and checkpoints, and open cases, meanwhile.
  // Files that the device did not sign say nothing: whoever can write to the disk puts them there, above
  // lines that were put aside as well.
  const std::uint64_t newest = newest_signed_size(log_folder, device);
  const std::vector<StatedByCase> by_cases = stated_by_cases(archive_of(log_folder), device);
  auto next_by_case = by_cases.begin();
  std::optional<std::string> contradicted_by;
  crypto::MerkleFrontier tree;
  std::optional<crypto::Sha256Digest> root_at_newest, root_at_seen;
  bool only_starts = true;
  std::vector<DamageClaim> damages;
  for_each_log_line(log_folder, [&](const LogLine& line) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
    if (tree.size() == newest) {
      root_at_newest = tree.root();
    }
    if (seen && tree.size() == seen->size) {
      root_at_seen = tree.root();
    }
    for (; next_by_case != by_cases.end() && next_by_case->size <= tree.size(); ++next_by_case) {
      if (next_by_case->root != tree.root() && !contradicted_by) contradicted_by = next_by_case->case_id;
    }
    only_starts = only_starts && (line.type == "boot" || line.type == "config-changed");
    // What nobody signed says nothing.
    if (line.type == "damage-found" && line.seq < newest) {
      const LogEntry entry = parse_log_entry(line.json).entry.value();
      damages.push_back({line.seq, std::get<LogDamageEntry>(entry.body).size});
    }
    if (std::ranges::find(question.types, line.type) == question.types.end()) {
      return;
    }
    const LogEntry entry = parse_log_entry(line.json).entry.value();
    // By no key that the log names instead: whoever can write to the disk adds a start of the machine that
    // names theirs, and the recorder's next entry signs over it.
    question.visit(
        {entry, line.seq, [&] { return is_signed_entry(log_folder, device, line.seq, tree.root()); }});
  });
  // Later checkpoints are over what was changed, too. Where something was changed behind them the newest
  // checkpoint does not fit.
  if (const std::optional<DamageClaim> damage = first_that_stands(log_folder, device, damages)) {
    throw_unknown(question, log_folder,
                  "says in its entry " + std::to_string(damage->entry) +
                      " that lines before it were changed after they were signed");
  }
  if (newest > tree.size()) {
    throw_unknown(question, log_folder,
                  "has " + std::to_string(tree.size()) + " entries where one was signed over " +
                      std::to_string(newest));
  }
  if (next_by_case != by_cases.end()) contradicted_by = by_cases.back().case_id;
  if (contradicted_by) {
    throw_unknown(question, log_folder,
                  "does not go on from the entries that it had when case " + *contradicted_by +
                      " was opened: its end was removed, or it was rewritten");
  }
  if (newest == 0 && !only_starts) {
    throw_unknown(question, log_folder, "has no checkpoint that is signed by " + device.name());
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

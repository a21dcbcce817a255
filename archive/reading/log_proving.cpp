#include "archive/reading/log_proving.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/excerpt_document.h"
#include "archive/format/log_entry.h"
#include "archive/reading/case_reader.h"
#include "archive/verify/case_against_log.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/excerpt_verifier.h"
#include "archive/verify/log_proof.h"
#include "archive/writing/log_reading.h"
#include "base/error.h"
#include "base/printable.h"
#include "crypto/merkle_tree.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

/// What the proof is for.
struct Subject {
  std::string case_id;
  std::optional<std::uint64_t> part_size;  // of an excerpt: of its case's entries, to which its lines lead
};

Subject subject_of(const fs::path& folder) {
  if (!is_excerpt(folder)) {
    return {CaseReader::open(folder).opening().case_id, std::nullopt};
  }
  const auto text = CaseFolder::open(folder).read_if_there(kExcerptFile, kMaximumExcerptBytes);
  const ExcerptParse parse = text ? parse_excerpt(*text) : ExcerptParse{std::nullopt, "it is far too long"};
  if (!parse.document) {
    throw Error("cannot prove where " + folder.string() + " belongs: its " + std::string(kExcerptFile) +
                " is of no excerpt: " + parse.problem);
  }
  return {parse.document->case_id, parse.document->size};
}

struct EndInLog {
  std::uint64_t entry = 0;
  std::string line;
  CaseClosedEntry closed;
  bool signed_then = false;  // by the device, before another entry followed
};

/// Whether a log that names this device is the one of `device`. Another key of its name is another device's.
bool is_its_key(const std::string& named, const crypto::VerifierKey& device) {
  try {
    return crypto::VerifierKey::parse(named) == device;
  } catch (const UsageError&) {
    return false;
  }
}

struct LogOfCase {
  std::optional<EndInLog> end;
  bool knows_it_of_another = false;  // in lines that stood there while the log named another device
};

/// The lines of the log into `tree`, and what they say of the case's end at last: the last line that the
/// device signed before another followed, or, where it signed none so, the last one that stood there while
/// the log was the device's. Anybody who can write to the log's disk can have added the others.
LogOfCase read_log_of(const fs::path& log_folder, const std::string& case_id,
                      const crypto::VerifierKey& device, crypto::MerkleTree& tree) {
  LogOfCase read;
  bool is_its = true;
  for_each_log_line(log_folder, [&](const LogLine& line) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
    const LogEntryParse parse = parse_log_entry(line.json);
    if (!parse.entry) {
      return;
    }
    if (const auto* boot = std::get_if<BootEntry>(&parse.entry->body)) {
      is_its = is_its_key(boot->device, device);
    } else if (const auto* changed = std::get_if<DeviceKeyChangedEntry>(&parse.entry->body)) {
      is_its = is_its_key(changed->device, device);
    }
    if (const auto* closed = std::get_if<CaseClosedEntry>(&parse.entry->body);
        closed != nullptr && closed->case_id == case_id) {
      const bool signed_then = is_signed_entry(log_folder, device, line.seq, tree.root(tree.size()));
      const bool was_signed = read.end && read.end->signed_then;
      if (signed_then || (is_its && !was_signed)) {
        read.end = EndInLog{line.seq, line.json, *closed, signed_then};
      }
      read.knows_it_of_another = read.knows_it_of_another || !is_its;
    }
  });
  return read;
}

/// The checkpoint of a note that holds in this log and covers the entry.
std::optional<crypto::Checkpoint> checkpoint_over(const std::string& note, const crypto::MerkleTree& tree,
                                                  std::uint64_t entry, const crypto::VerifierKey& device) {
  const crypto::OpenedNote opened = crypto::open_note(note, {device});
  const auto checkpoint = crypto::Checkpoint::parse(opened.text);
  const bool holds = !opened.failure && checkpoint && checkpoint->origin == log_origin(device.name()) &&
                     checkpoint->size > entry && checkpoint->size <= tree.size() &&
                     checkpoint->root == tree.root(checkpoint->size);
  return holds ? checkpoint : std::nullopt;
}

/// The one of the log's folder that covers the most.
std::optional<std::pair<OutsideNote, crypto::Checkpoint>> own_checkpoint(const fs::path& log_folder,
                                                                         const crypto::MerkleTree& tree,
                                                                         std::uint64_t entry,
                                                                         const crypto::VerifierKey& device) {
  const CaseFolder folder = CaseFolder::open(log_folder);
  std::vector<std::uint64_t> sizes = note_sizes(folder.list());
  std::ranges::reverse(sizes);
  for (const std::uint64_t size : sizes) {
    if (size <= entry) break;
    const auto note = folder.read_if_there(note_path(size), kMaximumNoteBytes);
    const auto checkpoint = note ? checkpoint_over(*note, tree, entry, device) : std::nullopt;
    if (checkpoint)
      return std::pair(OutsideNote{(log_folder / note_path(size)).string(), *note}, *checkpoint);
  }
  return std::nullopt;
}

}  // namespace

MadeLogProof prove_case_in_log(const fs::path& folder, const fs::path& log_folder,
                               const crypto::VerifierKey& device, const std::vector<OutsideNote>& kept,
                               const std::function<fs::path(const std::string& case_id)>& find_case) {
  const Subject subject = subject_of(folder);
  crypto::MerkleTree log;
  const LogOfCase read = read_log_of(log_folder, subject.case_id, device, log);
  const std::optional<EndInLog>& end = read.end;
  if (!end && read.knows_it_of_another) {
    throw Error("the appliance log in " + log_folder.string() + " tells of an end of case " +
                printable(subject.case_id) + " while it names another device than " + device.name() +
                ", and nowhere else: that proves nothing of what " + device.name() + " entered");
  }
  if (!end) {
    throw UsageError("the appliance log in " + log_folder.string() + " knows no end of case " +
                     printable(subject.case_id) +
                     ": it is still being recorded, or was never closed, or is another recorder's");
  }
  const fs::path case_folder = subject.part_size ? find_case(subject.case_id) : folder;
  crypto::MerkleTree lines;
  for_each_whole_line(case_folder,
                      [&](std::string_view line) { lines.append(crypto::merkle_leaf_hash(bytes_of(line))); });
  if (end->closed.size == 0 || end->closed.size > lines.size() ||
      lines.root(end->closed.size) != end->closed.root || subject.part_size.value_or(0) > lines.size()) {
    throw Error(
        "the case in " + case_folder.string() +
        " does not hold the entries with which, by the appliance log, it ended: 'kiroku verify' tells "
        "more");
  }
  std::optional<std::pair<OutsideNote, crypto::Checkpoint>> chosen;
  for (const OutsideNote& note : kept) {
    if (chosen) break;
    if (const auto checkpoint = checkpoint_over(note.text, log, end->entry, device))
      chosen = {note, *checkpoint};
  }
  if (!chosen) chosen = own_checkpoint(log_folder, log, end->entry, device);
  if (!chosen) {
    throw Error("no checkpoint of the appliance log covers its entry " + std::to_string(end->entry) +
                ", the case's end: 'kiroku log --verify' tells more");
  }
  LogProofExtra extra{end->line, {}};
  const std::uint64_t part = subject.part_size.value_or(end->closed.size);
  if (part > 0 && part != end->closed.size) {
    extra.consistency =
        lines.consistency_proof(std::min(part, end->closed.size), std::max(part, end->closed.size));
  }
  MadeLogProof made;
  made.proof = {extra.to_bytes(), end->entry, log.inclusion_proof(end->entry, chosen->second.size),
                chosen->first.text};
  made.entry = end->entry;
  made.case_id = subject.case_id;
  made.checkpoint = chosen->first.name;
  made.log = chosen->second;
  made.signed_then = end->signed_then;
  return made;
}

}  // namespace kiroku::archive

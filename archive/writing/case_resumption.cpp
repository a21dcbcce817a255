#include <algorithm>
#include <map>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/verify/case_against_log.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/found_files.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/case_writer_state.h"
#include "crypto/merkle_tree.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse_damaged(const fs::path& folder, const std::string& what) {
  throw Error("case " + folder.filename().string() + " is not taken up again, since " + what +
              ": `kiroku verify " + folder.string() + "` says more");
}

/// A recorder signs `close` and `erased` as soon as they stand in the ledger, and nothing is removed before.
/// Without a signature they say nothing that is lost with them, and whoever can write to the disk could have
/// put them there: to have a loss pass for the case's end, or segments removed.
bool needs_signature(std::string_view line) {
  const EntryParse parse = parse_case_entry(line);
  return parse.entry && (std::holds_alternative<CloseEntry>(parse.entry->body) ||
                         std::holds_alternative<ErasedEntry>(parse.entry->body));
}

/// Whether a line says anything of the case but about its time-stamps, which prove themselves.
bool is_claim(std::string_view line) {
  if (line.find(R"("token)") == std::string_view::npos) {
    return true;
  }
  const EntryParse parse = parse_case_entry(line);
  return !parse.entry || !(std::holds_alternative<TokenEntry>(parse.entry->body) ||
                           std::holds_alternative<TokenMissedEntry>(parse.entry->body));
}

}  // namespace

const OpenEntry& CaseWriter::State::check_opening(const CaseEntry& entry, const std::string& device) const {
  const auto* open = std::get_if<OpenEntry>(&entry.body);
  if (open == nullptr) {
    refuse_damaged(folder, "its ledger does not begin with open");
  }
  if (open->device != device) {
    throw UsageError("case " + folder.filename().string() + " was recorded by another device, " +
                     open->device + ": only that one can bring it to an end");
  }
  if (open->case_id != folder.filename().string()) {
    refuse_damaged(folder, "its ledger is that of case " + open->case_id);
  }
  return *open;
}

void CaseWriter::State::take_newest_note(std::uint64_t size, const crypto::Sha256Digest& root,
                                         FromBefore from_before) {
  const fs::path file = folder / note_path(size);
  const auto note = CaseFolder::open(folder, files).read_if_there(note_path(size), kMaximumNoteBytes);
  if (!note) {
    refuse_damaged(folder, file.string() + " cannot be read");
  }
  const crypto::OpenedNote opened = crypto::open_note(*note, {crypto::verifier_key_of(device_name, *key)});
  const bool is_signed = !opened.failure || opened.failure == crypto::NoteFailure::kLacksHardware ||
                         (opened.failure == crypto::NoteFailure::kLacksMlDsa && from_before.ml_dsa);
  const std::optional<crypto::Checkpoint> checkpoint = crypto::Checkpoint::parse(opened.text);
  if (!is_signed || !checkpoint || checkpoint->origin != case_origin(device_name, case_id) ||
      checkpoint->size != size || checkpoint->root != root) {
    refuse_damaged(folder,
                   "its newest checkpoint, " + file.filename().string() + ", does not fit its ledger");
  }
  last_checkpoint = StoredCheckpoint{size, root, *note, file};
}

bool CaseWriter::State::is_by_hardware(const std::map<std::uint64_t, crypto::Sha256Digest>& roots) const {
  const crypto::VerifierKey device = crypto::verifier_key_of(device_name, *key);
  const CaseFolder opened_folder = CaseFolder::open(folder, files);
  const std::string origin = case_origin(device_name, case_id);
  return std::any_of(roots.rbegin(), roots.rend(), [&](const auto& each) {
    const auto note = opened_folder.read_if_there(note_path(each.first), kMaximumNoteBytes);
    if (!note) {
      return false;
    }
    const crypto::OpenedNote opened = crypto::open_note(*note, {device});
    const auto name = crypto::HardwareVerifierKey::name_of(device_name);
    const bool has_line = device.hardware() ? opened.by_hardware
                                            : std::find(opened.signers.begin(), opened.signers.end(), name) !=
                                                  opened.signers.end();
    return has_line &&
           crypto::Checkpoint::parse(opened.text) == crypto::Checkpoint{origin, each.first, each.second};
  });
}

/// Nothing is written, read or removed through a link that somebody put in the place of a folder.
void refuse_linked_folders(const FileReading& files, const fs::path& folder) {
  std::vector<fs::path> folders;
  for (const std::string_view name :
       {kCheckpointsFolder, kTokensFolder, kSegmentsFolder, kAuthoritiesFolder}) {
    folders.push_back(folder / name);
  }
  for (std::size_t at = 0; at < folders.size(); ++at) {
    const std::optional<FileStatus> status = files.status(folders[at]);
    if (status && status->kind == FileStatus::Kind::kLink) {
      refuse_damaged(folder, folders[at].lexically_relative(folder).string() + " is a symbolic link");
    }
    if (folders[at] == folder / kSegmentsFolder && status && status->kind == FileStatus::Kind::kFolder) {
      for (const std::string& stream : files.names_in(folders[at])) {
        folders.push_back(folder / kSegmentsFolder / stream);
      }
    }
  }
}

std::unique_ptr<CaseWriter> CaseWriter::resume(FileSystem& files, const fs::path& folder,
                                               const crypto::SigningKey& key, const std::string& device_name,
                                               ApplianceLog* log,
                                               const std::function<void(const CaseEntry&)>& visit) {
  auto state = std::make_unique<State>(files, &key, device_name, log, folder.parent_path());
  state->folder = folder;
  state->case_id = folder.filename().string();
  refuse_linked_folders(files, folder);
  // Of a case from before the device had an ML-DSA key, by the log, no checkpoint needs to be signed by it.
  const ApplianceLog::StatedKeys since = log == nullptr ? ApplianceLog::StatedKeys{} : log->stated_keys();
  crypto::VerifierKey verifier = crypto::verifier_key_of(device_name, key);
  if (since.ml_dsa && verifier.ml_dsa()) verifier = verifier.with_ml_dsa(*verifier.ml_dsa(), *since.ml_dsa);
  State::FromBefore from_before{!since.ml_dsa, false};
  const std::string device = verifier.to_string();
  const std::uint64_t newest = newest_note(folder, files);
  // What is signed here is believed everywhere. Whoever can write to the disk, and has no key, could have cut
  // a case back to an earlier checkpoint, taken its checkpoints away, or put other lines there. So all is
  // read before anything is cut off, and judged again as it is read for good.
  std::optional<CaseAgainstLog> known;
  if (log != nullptr) {
    known.emplace(state->case_id, log->folder(), verifier, files);
  }
  std::optional<CaseAgainstLog> known_again = known;
  crypto::MerkleFrontier tree;
  std::optional<crypto::Sha256Digest> root;  // that the newest note must state
  // At the sizes up to it from the last claim on.
  std::map<std::uint64_t, crypto::Sha256Digest> roots_of_all_claims;
  const auto take_first = [&](std::string_view line) {
    if (const EntryParse first = tree.size() == 0 ? parse_case_entry(line) : EntryParse{}; first.entry) {
      const OpenEntry& open = state->check_opening(*first.entry, device);
      from_before = {!since.ml_dsa || open.appliance_log_size <= *since.ml_dsa,
                     since.hardware && open.appliance_log_size <= *since.hardware};
    }
    if (known) {
      known->take(line);
    }
    tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    if (tree.size() <= newest) {
      if (is_claim(line)) roots_of_all_claims.clear();
      roots_of_all_claims[tree.size()] = tree.root();
    }
    if (tree.size() == newest) {
      root = tree.root();
    }
  };
  for_each_whole_line(folder, take_first, files);
  if (const auto problem = known ? known->problem(newest) : std::nullopt) {
    refuse_damaged(folder, *problem);
  }
  if (newest > tree.size()) {
    refuse_damaged(folder, "a checkpoint covers " + std::to_string(newest) + " entries and there are " +
                               std::to_string(tree.size()));
  }
  if (newest > 0) {
    state->take_newest_note(newest, *root, from_before);
    state->rests_on_hardware = from_before.hardware || state->is_by_hardware(roots_of_all_claims);
    // Either the hardware was silent when the newest claims were signed, or somebody with a copy of the other
    // keys made them. Its signature now would cover both alike, so such a case goes on to its end without it.
    if (!state->rests_on_hardware) {
      state->ask_hardware = crypto::AskHardware::kNo;
    }
  }
  state->opening_vouched = newest > 0 || !known || known->opening_signed();
  tree = crypto::MerkleFrontier();
  root.reset();
  const auto take = [&](std::uint64_t seq, std::string_view line) {
    const EntryParse parse = parse_case_entry(line);
    if (!parse.entry || parse.entry->seq != seq) {
      refuse_damaged(folder, "line " + std::to_string(seq + 1) + " of its ledger is no entry" +
                                 (parse.problem.empty() ? "" : " (" + parse.problem + ")"));
    }
    if (seq == 0) {
      for (const StreamInfo& info : state->check_opening(*parse.entry, device).streams) {
        state->streams.push_back({info, {}, {}, {}});
      }
    }
    if (known_again) {
      known_again->take(line);
    }
    tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    if (tree.size() == newest) {
      root = tree.root();
    }
    state->last_mono_ns = std::max(state->last_mono_ns, parse.entry->at.mono_ns);
    state->account_for(parse.entry->body);
    visit(*parse.entry);
  };
  // Only what stands there already is of interest, not what is appended later.
  const auto reading = std::make_shared<Ledger::Visitor>(take);
  state->ledger = Ledger::open(
      files, folder / kLedgerFile, Ledger::Sharing::kExclusive, &state->reserve,
      [reading](std::uint64_t seq, std::string_view line) {
        if (*reading) {
          (*reading)(seq, line);
        }
      },
      [newest] { return newest; }, needs_signature);
  *reading = nullptr;
  state->torn_bytes = state->ledger->torn_bytes();
  state->unsigned_bytes = state->ledger->unsigned_bytes();
  if (state->ledger->size() == 0) {
    refuse_damaged(folder, "its ledger holds no whole entry");
  }
  const bool changed =
      (newest > 0 && root != state->last_checkpoint->root) || (known_again && known_again->problem(newest));
  if (changed) {
    refuse_damaged(folder, "its ledger changed while it was read");
  }
  return std::unique_ptr<CaseWriter>(new CaseWriter(std::move(state)));
}

}  // namespace kiroku::archive

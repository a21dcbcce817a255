#include "archive/verify/case_against_log.h"

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/line_reader.h"
#include "archive/format/log_entry.h"
#include "base/error.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

/// Whether a recovery writes such entries of a case in which nothing was recorded yet, up to its `close`: no
/// segment, for none was begun before the log's line was signed. What lies behind `close` is signed with it.
bool may_be_of_empty_case(const CaseEntryBody& body) {
  return std::holds_alternative<RecoveredEntry>(body) || std::holds_alternative<GapEntry>(body) ||
         std::holds_alternative<CloseEntry>(body);
}

}  // namespace

bool is_signed(const fs::path& folder, const crypto::Checkpoint& wanted, const crypto::VerifierKey& device,
               const FileReading& files) {
  const auto note = CaseFolder::open(folder, files).read_if_there(note_path(wanted.size), kMaximumNoteBytes);
  if (!note) {
    return false;
  }
  const crypto::OpenedNote opened = crypto::open_note(*note, {device});
  const bool is_of_log = wanted.origin == log_origin(device.name());
  const bool is_signed_as_case = !opened.failure || opened.failure == crypto::NoteFailure::kLacksHardware;
  return (is_of_log ? crypto::is_signed_for_log(opened, device, wanted.size) : is_signed_as_case) &&
         crypto::Checkpoint::parse(opened.text) == wanted;
}

void for_each_whole_line(const fs::path& folder, const std::function<void(std::string_view)>& take,
                         const FileReading& files) {
  const FileOpening ledger = CaseFolder::open(folder, files).open_file(kLedgerFile);
  if (!ledger.file) {
    throw Error("cannot read " + (folder / kLedgerFile).string() + ": it " + ledger.explanation);
  }
  LineReader reader(*ledger.file);
  LedgerLine line;
  while (reader.next(line) && !line.torn) {
    take(line.text);
  }
  // A line that is longer than any may be is not read to its end: whoever takes such a ledger up refuses it.
  if (!line.too_long) {
    ledger.file->require_read_to_end(line.offset + line.bytes);
  }
}

/// Whether the device is the log's from this entry on; nothing where the entry names none.
std::optional<bool> names(const LogEntryBody& body, const crypto::VerifierKey& device) {
  const auto* boot = std::get_if<BootEntry>(&body);
  const auto* changed = std::get_if<DeviceKeyChangedEntry>(&body);
  if (boot == nullptr && changed == nullptr) return std::nullopt;
  try {
    return crypto::VerifierKey::parse(boot != nullptr ? boot->device : changed->device) == device;
  } catch (const UsageError&) {
    return false;
  }
}

/// A note that cannot be read makes no line of another device one of this.
bool signed_if_readable(const std::function<bool()>& signed_here) {
  try {
    return signed_here();
  } catch (const Error&) {
    return false;
  }
}

bool may_name_a_device(std::string_view line) {
  return line.find(R"("boot")") != std::string_view::npos ||
         line.find(R"("device-key-changed")") != std::string_view::npos;
}

// Lines of the log that are no entries are the verifier's to find.
CaseAgainstLog::CaseAgainstLog(const std::string& case_id, const fs::path& log_folder,
                               const crypto::VerifierKey& device, const FileReading& files) {
  crypto::MerkleFrontier log_tree;
  bool is_devices = true;
  const auto take_line = [&](std::string_view line) {
    log_tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    if (line.find(case_id) == std::string_view::npos && !may_name_a_device(line)) {
      return;
    }
    const LogEntryParse parse = parse_log_entry(line);
    if (!parse.entry) {
      return;
    }
    const auto signed_here = [&] {
      return is_signed(log_folder, {log_origin(device.name()), log_tree.size(), log_tree.root()}, device,
                       files);
    };
    if (const std::optional<bool> named = names(parse.entry->body, device)) {
      is_devices = *named;
      return;
    }
    if (!is_devices && !signed_if_readable(signed_here)) {
      return;
    }
    if (const auto* opened = std::get_if<CaseOpenedEntry>(&parse.entry->body);
        opened != nullptr && opened->case_id == case_id && !opening_line_) {
      opening_line_ = opened->sha256;
      opening_signed_ = signed_here();
    } else if (const auto* checkpoint = std::get_if<CaseCheckpointEntry>(&parse.entry->body);
               checkpoint != nullptr && checkpoint->case_id == case_id) {
      roots_.emplace(checkpoint->size, checkpoint->root);
    } else if (const auto* closed = std::get_if<CaseClosedEntry>(&parse.entry->body);
               closed != nullptr && closed->case_id == case_id) {
      roots_.emplace(closed->size, closed->root);
    }
  };
  for_each_whole_line(log_folder, take_line, files);
}

void CaseAgainstLog::take(std::string_view line) {
  if (tree_.size() == 0 && opening_line_ && crypto::sha256(bytes_of(line)) != *opening_line_) {
    differs_ = "the appliance log knows another first entry of it";
  }
  if (tree_.size() > 0 && opening_line_ && !opening_signed_ && !recorded_) {
    const EntryParse parse = parse_case_entry(line);
    const bool begins = tree_.size() == 1;  // a recovery does, with `recovered`
    recorded_ = !parse.entry || !may_be_of_empty_case(parse.entry->body) ||
                (begins && !std::holds_alternative<RecoveredEntry>(parse.entry->body));
  }
  tree_.append(crypto::merkle_leaf_hash(bytes_of(line)));
  const auto [first, end] = roots_.equal_range(tree_.size());
  for (auto each = first; each != end && !differs_; ++each) {
    if (each->second != tree_.root()) {
      differs_ = "the first " + std::to_string(tree_.size()) +
                 " entries are not those whose root the appliance log states";
    }
  }
}

std::optional<std::string> CaseAgainstLog::problem(std::uint64_t signed_size) const {
  if (differs_) {
    return differs_;
  }
  const std::uint64_t known = roots_.empty() ? 0 : roots_.rbegin()->first;
  if (known > tree_.size()) {
    return "the appliance log knows " + std::to_string(known) + " entries of it and there are " +
           std::to_string(tree_.size());
  }
  if (known > signed_size) {
    return "the appliance log knows a checkpoint of it over " + std::to_string(known) + " entries, and " +
           (signed_size == 0 ? std::string("there is none")
                             : "the newest one there covers " + std::to_string(signed_size));
  }
  if (recorded_ && signed_size == 0) {
    return "nobody signed in the appliance log that it was opened, before another line followed there";
  }
  return std::nullopt;
}

}  // namespace kiroku::archive

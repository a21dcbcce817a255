#include <algorithm>
#include <map>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/writing/appliance_log_state.h"
#include "archive/writing/log_case_begin.h"
#include "archive/writing/log_deeds.h"
#include "base/error.h"

namespace kiroku::archive {

namespace fs = std::filesystem;

void ApplianceLog::State::settle_locked() {
  ledger->catch_up();
  look_behind_locked();
  if (const std::string why = why_other_keys(); !why.empty()) throw Error(why);
  if (!device.hardware() && in_log.hardware() != nullptr) {
    silence = "the program that signed was given no key in hardware";
  }
  // What was put aside nobody finds in the log any more, should this program enter nothing.
  if (!was_put_aside) return;
  try {
    state_unsigned_locked();
    was_put_aside = false;
  } catch (const Error&) {  // NOLINT(bugprone-empty-catch): the next entry states it
  }
}

std::string ApplianceLog::State::why_other_keys() const {
  if (const StatedInLog::StatedKey* const ml_dsa = in_log.other_ml_dsa(); ml_dsa != nullptr) {
    return "the appliance log in " + folder.string() + " states in its entry " +
           std::to_string(ml_dsa->entry) + " that " + device.name() +
           " signs with an ML-DSA key, too, which was not given: put device-ml-dsa.key of this home "
           "back, and start whatever runs from before it was made anew";
  }
  const StatedInLog::StatedKey* const hardware = in_log.other_hardware();
  if (hardware != nullptr && device.hardware()) {
    return "the appliance log in " + folder.string() + " states in its entry " +
           std::to_string(hardware->entry) + " another key in the hardware of " + device.name() +
           " than device-hardware.json: put the file back that belongs to this home. After hardware was "
           "replaced, make a new home (docs/how-to/keep-a-key-in-hardware.md)";
  }
  return "";
}

void ApplianceLog::State::look_behind_locked() {
  const std::uint64_t size = ledger->size();
  looked_at = std::min(looked_at, size);
  // Lines that were signed may have become shorter, longer, or fewer.
  const bool were_others = std::exchange(was_read_anew, false) && are_others_than_signed();
  if (size == looked_at) return;
  // The home's own checkpoint may show it, too.
  bool damaged = were_others || is_damage_open() || !lacks.empty();
  std::optional<UnsignedLines> behind;
  bool is_unread = false;  // what the device signed here
  try {
    is_unread = !read_own_of_now(damaged);
    if (signed_until < size) take_remembered();
    if (signed_until < size) {
      is_unread = !read_newest_fitting() || is_unread;
      if (!why_other_keys().empty()) return;
      behind = lines_behind();
      if (were_changed(*behind)) {
        damaged = true;
        behind = lines_behind();
      }
    }
  } catch (const Error&) {
    // It keeps nobody from recording; what cannot be read is left to whoever verifies.
  }
  if (behind) {
    // Fewer were read where more zeros stand there than are read, and more where somebody adds lines now.
    behind->end = std::max(behind->end, ledger->size());
    settle(*behind, damaged, is_unread && !is_remembered_here);
  }
  looked_at = ledger->size();
}

UnsignedLines ApplianceLog::State::lines_behind() const {
  // Whoever can write to the archive opens as many cases there as they like. So many never begin between
  // two checkpoints, and the log is read once for all of them.
  constexpr int kMostCases = 1024;
  int looked_for = 0;
  std::map<std::uint64_t, std::vector<crypto::Sha256Digest>> went_on_from;
  UnsignedLines lines = unsigned_lines(
      files, ledger->file(), signed_until, keys_of_lines(), damage, [&](const CaseOpenedEntry& opened) {
        if (++looked_for > kMostCases) return false;
        const CaseBegin begin =
            begin_of_case(files, folder.parent_path(), own_keys.device, by_ed25519(), opened);
        if (begin.log) went_on_from[begin.log->size].push_back(begin.log->root);
        return begin.is_here;
      });
  if (lines.opens_here || went_on_from.empty()) return lines;
  std::vector<std::uint64_t> sizes;
  for (const auto& [size, root] : went_on_from) sizes.push_back(size);
  const std::vector<crypto::Sha256Digest> roots = roots_of_lines(files, ledger->file(), sizes);
  for (std::size_t at = 0; at < roots.size(); ++at) {
    const std::vector<crypto::Sha256Digest>& stated = went_on_from.at(sizes[at]);
    lines.opens_here = lines.opens_here || std::ranges::find(stated, roots[at]) != stated.end();
  }
  return lines;
}

bool ApplianceLog::State::were_changed(const UnsignedLines& behind) {
  if (!signed_root) signed_root = behind.root_before;
  if (!signed_root || behind.root_before == signed_root) {
    // Another program found it, and stated and signed it: what is signed here must go on from that.
    if (behind.end != ledger->size() || behind.root == ledger->root()) return false;
    ledger->read_again();
    return true;
  }
  state_damage(behind.root_before);
  ledger->read_again();
  return true;
}

void ApplianceLog::State::settle(const UnsignedLines& behind, bool damaged, bool is_unread) {
  if (is_unread) {
    // It is neither cut off nor taken for the device's.
    if (behind.foreign || (!damaged && behind.demanding > 0)) leave_unsigned(behind.end);
    return;
  }
  bool left = false;
  std::uint64_t demanding = behind.demanding, end = behind.end;
  if (behind.foreign) {
    // Whose log it is nobody knows then: another device's, or its checkpoints were taken away.
    const bool is_anothers = signed_until == 0;
    if (!damaged && !is_anothers && !behind.opens_here &&
        put_aside(behind.foreign->number, behind.foreign->offset)) {
      end = behind.foreign->number;
    } else {
      left = true;
      demanding += behind.demanding_behind;
    }
  }
  if (!damaged && !left && demanding == 1) {
    if (behind.first->kind == UnsignedLine::Kind::kStatement)
      take_back_from(*behind.first, end - behind.first->number);
    return;
  }
  if (left || (!damaged && demanding > 1)) leave_unsigned(end);
}

void ApplianceLog::State::leave_unsigned(std::uint64_t end) {
  unstated.push_back({found_deed(signed_until, end - 1), {}});
  remark(
      "the entries from " + std::to_string(signed_until) + " to " + std::to_string(end - 1) +
      " of the appliance log in " + folder.string() +
      " have no checkpoint of this device that can be read: somebody added them, or took checkpoints away. "
      "They are left where they are, and the log says so from now on");
}

void ApplianceLog::State::take_back_from(const UnsignedLine& line, std::uint64_t lines) {
  try {
    set_aside_with_room(line.number, line.offset, Telling::kNone);
  } catch (const IoError&) {
    if (lines > 1) {
      unstated.push_back({found_deed(line.number, line.number + lines - 1), {}});
      return;
    }
  }
  ledger->take_back(line.number, true);
}

bool ApplianceLog::State::put_aside(std::uint64_t seq, std::uint64_t offset) {
  if (!keep_aside(seq, offset)) return false;
  ledger->take_back(seq, true);
  return true;
}

bool ApplianceLog::State::keep_aside(std::uint64_t seq, std::uint64_t offset) {
  try {
    const SetAside kept = set_aside_with_room(seq, offset, Telling::kFollows);
    // Of what whoever adds lines all the time has put aside, the next start tells the rest.
    constexpr std::size_t kMostUnstated = 64;
    if (unstated.size() < kMostUnstated) unstated.push_back({set_aside_deed(seq, kept), kept});
    was_put_aside = true;
    remark("lines stood in the appliance log from entry " + std::to_string(seq) +
           " on that this device did not write: whoever can write to the archive's disk put them there. They "
           "count for nothing, and " +
           (kept.kept == kept.stood ? std::string("lie in ")
                                    : "the first " + std::to_string(kept.kept) + " of " +
                                          std::to_string(kept.stood) + " bytes, without holes, lie in ") +
           kept.file.string() + " now: keep that file, and find out who writes there");
    return true;
  } catch (const IoError& error) {
    remark("lines stand in the appliance log from entry " + std::to_string(seq) +
           " on that this device did not write, and they cannot be put aside: " + error.what());
    return false;
  }
}

Ledger::Aside ApplianceLog::State::put_no_entry_aside(std::uint64_t seq, std::uint64_t offset,
                                                      const Ledger::Replace& replace) {
  if (const std::uint64_t covered = covered_size(); covered > seq)
    return replace ? mark_changed(seq, offset, covered, replace) : Ledger::Aside::kStays;
  cut_off_no_entry(seq, offset);
  return Ledger::Aside::kMayGo;
}

void ApplianceLog::State::cut_off_no_entry(std::uint64_t seq, std::uint64_t offset) {
  if (keep_aside(seq, offset)) return;
  // Nothing could be written behind it, and it is no entry.
  remark(
      "that line is longer than any entry, or holds a zero byte as none does, so it was cut off all the "
      "same");
}

Ledger::Aside ApplianceLog::State::mark_changed(std::uint64_t seq, std::uint64_t offset,
                                                std::uint64_t covered, const Ledger::Replace& replace) {
  const fs::path file = folder / kLedgerFile;
  ChangedAside changed;
  try {
    with_room(offset,
              [&] { changed = set_changed_aside(files, file, seq, offset, covered, folder.parent_path()); });
  } catch (const Error& error) {
    remark("lines of the appliance log in " + folder.string() + " from entry " + std::to_string(seq) +
           " on, which this device signed, are no entries any more, and nothing can be entered: the lines "
           "behind them cannot be copied: " +
           error.what());
    return Ledger::Aside::kStays;
  }
  if (changed.rest) cut_off_no_entry(changed.rest->number, changed.rest->offset);
  if (changed.lines > 0) {
    unstated.push_back({changed_deed(seq, changed), changed.kept});
    was_put_aside = true;
  }
  std::string and_then = changed.lines > 0 ? ": keep that file" : "";
  try {
    reserve.support([&] { replace(files.open_to_read(changed.instead)); });
    files.remove(changed.instead);
  } catch (const SyncError&) {
    throw;
  } catch (const Error& error) {
    and_then = ", and the lines behind them in " + changed.instead.string() +
               ", as not all of them could be written back (" + error.what() + "): keep " +
               (changed.lines > 0 ? "both files" : "that file");
  }
  if (changed.lines == 0) {
    remark("entry " + std::to_string(seq) + " of the appliance log in " + folder.string() +
           ", which this device had signed, had lost its end on the disk: what is left of it stays, as a "
           "line" +
           and_then + ". Find out who writes there");
    return Ledger::Aside::kReplaced;
  }
  remark(std::to_string(changed.lines) + (changed.lines == 1 ? " line" : " lines") +
         " of the appliance log in " + folder.string() + ", from entry " + std::to_string(seq) +
         " on, which this device had signed, became longer than any entry, or zeros: somebody changed them "
         "on the disk. In the place of each stands a mark now, and what stood there lies in " +
         changed.kept.file.string() + and_then +
         ", put back a copy of the log that holds, and find out who writes there");
  return Ledger::Aside::kReplaced;
}

SetAside ApplianceLog::State::set_aside_with_room(std::uint64_t seq, std::uint64_t offset, Telling telling) {
  const fs::path file = folder / kLedgerFile;
  SetAside kept;
  with_room(offset, [&] { kept = set_aside(files, file, seq, offset, folder.parent_path(), telling); });
  return kept;
}

void ApplianceLog::State::with_room(std::uint64_t offset, const std::function<void()>& write) {
  constexpr std::uint64_t kShort = 1U << 18U;
  // Holes take none.
  if (bytes_to_keep(files, folder / kLedgerFile, offset) <= kShort) {
    reserve.support(write);
  } else {
    write();
  }
}

bool ApplianceLog::State::is_damage_open() const {
  return damage && std::ranges::none_of(in_log.damages(), [&](const StatedInLog::StatedDamage& each) {
           return each.entry < signed_until && is_that_damage(each.damage);
         });
}

bool ApplianceLog::State::is_that_damage(const LogDamageEntry& stated) const {
  // Where lines were cut off, there may be so many again meanwhile.
  return stated.size == damage->size && stated.stated_root == damage->stated_root &&
         (!stated.root || stated.root == damage->root);
}

LogKeys ApplianceLog::State::keys_of_lines() const {
  LogKeys keys = own_keys;
  if (const StatedInLog::StatedKey* const hardware = in_log.hardware();
      hardware != nullptr && keys.hardware.empty()) {
    keys.hardware = hardware->key;
  }
  if (const StatedInLog::StatedKey* const attestation = in_log.attestation(); attestation != nullptr) {
    keys.attestation = attestation->key;
  }
  return keys;
}

void ApplianceLog::State::remark(const std::string& sentence) {
  // Whoever adds lines all the time fills no memory.
  constexpr std::size_t kMostRemarks = 16;
  if (remarks.size() == kMostRemarks) return;
  remarks.push_back(sentence);
  if (!tell) return;
  tell(sentence);
  handed_out = remarks.size();
}

bool ApplianceLog::State::are_others_than_signed() {
  if (signed_until == 0 || !signed_root) return false;
  std::optional<crypto::Sha256Digest> root;
  try {
    root = root_of_first(signed_until);
  } catch (const Error&) {
    return false;
  }
  if (root == signed_root) return false;
  state_damage(root);
  // What follows is judged from here on.
  if (!root) is_signed_until(ledger->size(), ledger->root());
  return true;
}

void ApplianceLog::State::state_damage(const std::optional<crypto::Sha256Digest>& root) {
  damage = LogDamageEntry{signed_until, *signed_root, root};
  damage_stated = std::ranges::any_of(
      in_log.damages(), [&](const StatedInLog::StatedDamage& each) { return is_that_damage(each.damage); });
  remark("lines of the appliance log in " + folder.string() + " were changed while it was open: the first " +
         std::to_string(signed_until) +
         " are not those that this device signed. All stays as it is, and the log says so from now on: "
         "'kiroku log --verify' tells which checkpoint no longer fits");
  signed_root = root;
}

std::string ApplianceLog::State::words_of_damage() const {
  if (!damage) {
    return "";
  }
  return "the appliance log in " + folder.string() +
         (damage->root ? " has other lines than those over which its checkpoint of " +
                             std::to_string(damage->size) + " entries was signed"
                       : " has fewer lines than the " + std::to_string(damage->size) +
                             " over which a checkpoint of it was signed") +
         ": it was changed on the disk. Holds and consents cannot be told from it, and nothing is erased: "
         "put back a "
         "copy that holds; 'kiroku log --verify' tells more";
}

}  // namespace kiroku::archive

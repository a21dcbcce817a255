#include "archive/verify/outside_notes.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/verify/outside_copy.h"
#include "base/number_text.h"
#include "crypto/note_signers.h"

namespace kiroku::archive {

namespace {

Place in_ledger(std::uint64_t entry) { return {std::string(kLedgerFile), entry}; }

bool is_of_a_log(const crypto::Checkpoint& checkpoint) { return checkpoint.origin.ends_with("/log"); }

using Signers = std::vector<const crypto::VerifierKey*>;

bool is_among(const Signers& signers, const crypto::VerifierKey& device) {
  return std::ranges::any_of(signers, [&](const crypto::VerifierKey* each) { return *each == device; });
}

bool have_one_in_common(const Signers& one, const Signers& other) {
  return std::ranges::any_of(one, [&](const crypto::VerifierKey* each) { return is_among(other, *each); });
}

}  // namespace

OutsideNotes::OutsideNotes(const VerifyOptions& options, FindingList& findings)
    : options_(&options), findings_(&findings) {
  for (const OutsideNote& note : options.against) {
    judge(note);
  }
  for (const OutsideCopy& copy : options.copies) {
    for (const OutsideCopy::Note& note : copy.notes) {
      if (note.checkpoint.size > 0) {
        notes_.push_back({{}, {}, note.checkpoint, false, {}, Signature::kUnjudged, &copy, &note});
      }
    }
  }
  std::stable_sort(notes_.begin(), notes_.end(),
                   [](const Judged& a, const Judged& b) { return a.checkpoint.size < b.checkpoint.size; });
  compare_with_each_other();
}

VerifyOptions with_notes_of_logs(const VerifyOptions& options, bool of_logs) {
  VerifyOptions chosen = options;
  std::erase_if(chosen.against, [&](const OutsideNote& note) {
    const auto checkpoint = crypto::Checkpoint::parse(crypto::open_note(note.text, {}).text);
    return (checkpoint && is_of_a_log(*checkpoint)) != of_logs;
  });
  std::erase_if(chosen.copies, [&](OutsideCopy& copy) {
    const bool shows_nothing = copy.notes.empty();
    std::erase_if(copy.notes,
                  [&](const OutsideCopy::Note& note) { return is_of_a_log(note.checkpoint) != of_logs; });
    return copy.notes.empty() && (of_logs || !shows_nothing);
  });
  return chosen;
}

void OutsideNotes::add_shown(const std::string& origin, const crypto::VerifierKey& device) {
  const auto is_it = [&](const Shown& each) { return each.origin == origin && each.device == device; };
  if (std::ranges::none_of(shown_, is_it)) shown_.push_back({origin, device});
}

OutsideNotes::Signed OutsideNotes::judge_signature(const std::string& name, const std::string& text,
                                                   const crypto::Checkpoint& checkpoint) const {
  // A device speaks for its own log and cases, never for another's.
  Signers named;
  std::vector<crypto::VerifierKey> keys;
  for (const crypto::VerifierKey& device : options_->devices) {
    if (!is_origin_of(checkpoint.origin, device)) continue;
    named.push_back(&device);
    keys.push_back(device);
  }
  const crypto::OpenedNote opened = crypto::open_note(text, keys);
  Signed result;
  if (opened.failure == crypto::NoteFailure::kUnknownKey) {
    result.refusal = {"outside-note-untrusted",
                      name + " is not signed by a trusted device for \"" + checkpoint.origin +
                          "\", so nothing was compared with it: anybody can write such a note"};
    return result;
  }
  result.alone = opened.failure == crypto::NoteFailure::kLacksMlDsa ||
                 opened.failure == crypto::NoteFailure::kLacksHardware;
  if (opened.failure && !result.alone) {
    result.refusal = {"outside-note-invalid",
                      name + " does not hold, so nothing was compared with it: " + opened.explanation};
    return result;
  }
  for (const std::size_t place : crypto::signers_among(text, keys)) result.by.push_back(named[place]);
  return result;
}

void OutsideNotes::judge(const OutsideNote& note) {
  const crypto::OpenedNote unjudged = crypto::open_note(note.text, {});
  std::optional<crypto::Checkpoint> checkpoint = crypto::Checkpoint::parse(unjudged.text);
  if (!checkpoint) {
    findings_->add("outside-note-invalid", {},
                   note.name + " is no signed checkpoint, so nothing was compared with it" +
                       (unjudged.text.empty() ? ": " + unjudged.explanation : ""));
    return;
  }
  Signed judged = judge_signature(note.name, note.text, *checkpoint);
  if (judged.refusal) {
    findings_->add(judged.refusal->code, {}, judged.refusal->text);
    return;
  }
  if (checkpoint->size == 0) {
    findings_->add("outside-note-unchecked", {},
                   note.name + " is of no entry, and everything begins with none, so it was not compared");
    return;
  }
  notes_.push_back({note.name, note.text, std::move(*checkpoint), judged.alone, std::move(judged.by)});
}

bool OutsideNotes::is_signed(Judged& note) {
  if (note.signature == Signature::kUnjudged) {
    note.name = (note.copy->folder / note.in_copy->file).string();
    const std::optional<std::string> text = text_of_note(*note.copy, *note.in_copy);
    Signed judged = text ? judge_signature(note.name, *text, note.checkpoint) : Signed{};
    note.signature = text && !judged.refusal ? Signature::kHolds : Signature::kFails;
    note.alone = judged.alone;
    note.signers = std::move(judged.by);
  }
  return note.signature == Signature::kHolds;
}

void OutsideNotes::add_misfit(const Judged& note, CodeName code, const Place& place,
                              const std::string& text) {
  if (note.alone) {
    findings_->add("outside-note-not-by-both", place,
                   text +
                       ". The note lacks the signature by a key that the device has beside Ed25519, so this "
                       "shows nothing if somebody has or can forge the others");
  } else {
    findings_->add(code, place, text);
  }
}

bool OutsideNotes::is_by_what_is_shown(const Contradiction& each) const {
  return shown_.empty() || std::ranges::any_of(shown_, [&](const Shown& shown) {
           return is_among(each.one->signers, shown.device) && is_among(each.other->signers, shown.device);
         });
}

bool OutsideNotes::contradict_each_other() const {
  return std::ranges::any_of(contradictions_, [&](const Contradiction& each) {
    return !each.one->alone && !each.other->alone && is_by_what_is_shown(each);
  });
}

void OutsideNotes::tell(const Contradiction& each) {
  const Judged& one = *each.one;
  const Judged& other = *each.other;
  const std::string told = one.name + " and " + other.name +
                           " are both signed by one key of the device for \"" + one.checkpoint.origin +
                           "\" with " + counted(one.checkpoint.size, "entry", "entries") +
                           " and different roots: it signed two histories";
  if (is_by_what_is_shown(each)) {
    add_misfit(one.alone ? one : other, "outside-notes-contradict", {}, told + ", whatever is shown now");
  } else {
    findings_->add("outside-note-of-other-origin", {},
                   told + ", and what was shown is another device's, which is not accused by that");
  }
}

void OutsideNotes::compare_with_each_other() {
  for (std::size_t i = 0; i < notes_.size(); ++i) {
    if (notes_[i].copy != nullptr) {
      continue;
    }
    for (std::size_t j = i + 1; j < notes_.size() && notes_[j].checkpoint.size == notes_[i].checkpoint.size;
         ++j) {
      const crypto::Checkpoint& one = notes_[i].checkpoint;
      const crypto::Checkpoint& other = notes_[j].checkpoint;
      if (notes_[j].copy == nullptr && one.origin == other.origin && one.root != other.root &&
          have_one_in_common(notes_[i].signers, notes_[j].signers)) {
        contradictions_.push_back({&notes_[i], &notes_[j]});
      }
    }
  }
  for (auto first = notes_.begin(); first != notes_.end();) {
    std::map<std::string, std::vector<Judged*>> by_origin;
    auto last = first;
    for (; last != notes_.end() && last->checkpoint.size == first->checkpoint.size; ++last) {
      by_origin[last->checkpoint.origin].push_back(&*last);
    }
    for (auto& [origin, notes] : by_origin) {
      compare_at_one_size(std::move(notes));
    }
    first = last;
  }
}

void OutsideNotes::compare_at_one_size(std::vector<Judged*> notes) {
  const auto differ = [](const Judged* one, const Judged* other) {
    return one->checkpoint.root != other->checkpoint.root;
  };
  // Whoever could write to a copy can have put any number of notes there that nobody signed.
  if (std::ranges::adjacent_find(notes, differ) == notes.end()) return;
  std::erase_if(notes, [&](Judged* note) { return !is_signed(*note); });
  // Of two by one key that differ one differs from any third. Of each key one pair that accuses is enough,
  // and those by all keys of a device do: whatever lies between them.
  const auto known = static_cast<std::ptrdiff_t>(contradictions_.size());
  const auto take_two_of = [&](const crypto::VerifierKey& device, bool may_be_alone) {
    const auto is_wanted = [&](const Judged* note) {
      return (may_be_alone || !note->alone) && is_among(note->signers, device);
    };
    const auto in_copy = std::ranges::find_if(
        notes, [&](const Judged* note) { return note->copy != nullptr && is_wanted(note); });
    if (in_copy == notes.end()) return false;
    const auto other = std::ranges::find_if(
        notes, [&](const Judged* note) { return is_wanted(note) && differ(note, *in_copy); });
    if (other == notes.end()) return false;
    const Contradiction found{*std::min(in_copy, other), *std::max(in_copy, other)};
    if (std::find(contradictions_.begin() + known, contradictions_.end(), found) == contradictions_.end())
      contradictions_.push_back(found);
    return true;
  };
  for (const crypto::VerifierKey& device : options_->devices) {
    if (!take_two_of(device, false)) take_two_of(device, true);
  }
}

void OutsideNotes::reached(std::uint64_t size, const RootTest& fits, bool tree_known) {
  auto each = std::lower_bound(notes_.begin(), notes_.end(), size, [](const Judged& note, std::uint64_t at) {
    return note.checkpoint.size < at;
  });
  for (; each != notes_.end() && each->checkpoint.size == size; ++each) {
    each->answer = !tree_known                   ? Answer::kUnknown
                   : fits(each->checkpoint.root) ? Answer::kHolds
                                                 : Answer::kDiffers;
  }
}

bool OutsideNotes::holds_at(std::uint64_t size, const crypto::VerifierKey& device) {
  const std::string origin = log_origin(device.name());
  const auto first =
      std::ranges::lower_bound(notes_, size, {}, [](const Judged& note) { return note.checkpoint.size; });
  for (auto note = first; note != notes_.end() && note->checkpoint.size == size; ++note) {
    if (note->answer == Answer::kHolds && note->checkpoint.origin == origin && is_signed(*note) &&
        !note->alone && is_among(note->signers, device)) {
      return true;
    }
  }
  return false;
}

std::vector<OutsideNotes::Held> OutsideNotes::held_notes() {
  std::vector<Held> held;
  std::set<const OutsideCopy*> known;  // whose newest one is among them
  for (auto note = notes_.rbegin(); note != notes_.rend(); ++note) {
    const bool is_asked = note->copy == nullptr || !known.contains(note->copy);
    if (note->answer != Answer::kHolds || !is_asked || !is_signed(*note) || !is_of_what_is_shown(*note)) {
      continue;
    }
    std::vector<crypto::VerifierKey> signers;
    for (const crypto::VerifierKey* each : note->signers) signers.push_back(*each);
    if (note->copy == nullptr) {
      held.push_back({note->name, note->text, note->checkpoint, std::move(signers)});
    } else if (auto text = text_of_note(*note->copy, *note->in_copy)) {
      known.insert(note->copy);
      held.push_back({note->name, std::move(*text), note->checkpoint, std::move(signers)});
    }
  }
  std::ranges::reverse(held);
  return held;
}

bool OutsideNotes::has_shown_origin(const Judged& note) const {
  return std::ranges::find(shown_, note.checkpoint.origin, &Shown::origin) != shown_.end();
}

bool OutsideNotes::is_of_what_is_shown(const Judged& note) const {
  return std::ranges::any_of(shown_, [&](const Shown& each) {
    return each.origin == note.checkpoint.origin && is_among(note.signers, each.device);
  });
}

std::uint64_t OutsideNotes::same_until(const Judged& note) const {
  std::uint64_t same = 0;
  for (const Judged& older : notes_) {
    if (older.checkpoint.size >= note.checkpoint.size) break;
    if (older.copy == nullptr && older.answer == Answer::kHolds && !older.alone &&
        older.checkpoint.origin == note.checkpoint.origin &&
        have_one_in_common(older.signers, note.signers)) {
      same = older.checkpoint.size;
    }
  }
  return same;
}

void OutsideNotes::finish(std::uint64_t size, bool whole_ledger) {
  if (std::exchange(finished_, true)) {
    return;
  }
  for (const Contradiction& each : contradictions_) tell(each);
  for (Judged& note : notes_) {
    if (note.answer == Answer::kNotReached && !whole_ledger) note.answer = Answer::kUnknown;
    if (note.copy == nullptr) tell(note, size, "");
  }
  for (const OutsideCopy& copy : options_->copies) {
    finish_copy(copy, size);
  }
}

void OutsideNotes::tell(const Judged& note, std::uint64_t size, const std::string& behind) {
  const std::uint64_t stated = note.checkpoint.size;
  if (shown_.empty()) {
    findings_->add("outside-note-unchecked", {},
                   note.name + " was not compared: what is here does not show whose it is" + behind);
  } else if (!is_of_what_is_shown(note)) {
    tell_of_another(note, behind);
  } else if (note.answer == Answer::kHolds) {
    findings_->add("outside-note-holds", {},
                   note.name + " holds: the first " + counted(stated, "entry", "entries") +
                       " are those that it was signed of" + behind);
  } else if (note.answer == Answer::kDiffers) {
    tell_fork(note, same_until(note), behind);
  } else if (note.answer == Answer::kNotReached) {
    add_misfit(note, "outside-note-rolled-back", in_ledger(size),
               note.name + " was signed of " + counted(stated, "entry", "entries") + " and there are " +
                   std::to_string(size) + ": the last " + counted(stated - size, "entry", "entries") +
                   " were removed, or this is a copy from before" + behind);
  } else {
    findings_->add("outside-note-unchecked", {},
                   note.name + " was signed of " + counted(stated, "entry", "entries") +
                       ", and what is here does not show the root at that size, so it was not compared" +
                       behind);
  }
}

void OutsideNotes::tell_fork(const Judged& note, std::uint64_t same, const std::string& behind) {
  add_misfit(note, "outside-note-forked", in_ledger(same),
             "the first " + counted(note.checkpoint.size, "entry", "entries") + " are not those that " +
                 note.name +
                 " was signed of: the device signed another history, which parts from this one at entry " +
                 std::to_string(same) + " or later" + behind);
}

void OutsideNotes::tell_of_another(const Judged& note, const std::string& behind) {
  const std::string of = note.name + " is of \"" + note.checkpoint.origin + "\"";
  findings_->add("outside-note-of-other-origin", {},
                 has_shown_origin(note)
                     ? of + " by another trusted key of that name, " + note.signers.front()->to_string() +
                           ", which did not sign what was shown: it is another device's, so it was not "
                           "compared" +
                           behind
                     : of + ", which is not what was shown, so it was not compared" + behind);
}

// All of its notes bind the device, under whichever names they lie there: the newest one of each answer is
// told. What nobody signed, or was signed for something else, takes none of that back.
void OutsideNotes::finish_copy(const OutsideCopy& copy, std::uint64_t size) {
  const std::string behind = words_of_others(copy);
  std::vector<Judged*> all;  // the newest first
  for (auto note = notes_.rbegin(); note != notes_.rend(); ++note) {
    if (note->copy == &copy) all.push_back(&*note);
  }
  // Signatures are asked for last, and by whom they are behind that.
  const auto newest = [&](const auto& wanted, const auto& wanted_by) {
    const auto by = [&](bool may_be_alone) {
      const auto found = std::ranges::find_if(all, [&](Judged* note) {
        return wanted(*note) && is_signed(*note) && wanted_by(*note) && (may_be_alone || !note->alone);
      });
      return found == all.end() ? nullptr : *found;
    };
    Judged* const accusing = by(false);
    return accusing != nullptr ? accusing : by(true);
  };
  const auto is_of_it = [&](const Judged& note) { return is_of_what_is_shown(note); };
  const auto with = [&](Answer answer) {
    return newest([&](const Judged& note) { return note.answer == answer && has_shown_origin(note); },
                  is_of_it);
  };
  Judged* const held = with(Answer::kHolds);
  Judged* const forked = with(Answer::kDiffers);
  Judged* const beyond = with(Answer::kNotReached);
  if (forked != nullptr) {
    const Judged* const before = newest(
        [&](const Judged& note) {
          return note.answer == Answer::kHolds && note.checkpoint.size < forked->checkpoint.size &&
                 note.checkpoint.origin == forked->checkpoint.origin;
        },
        [&](const Judged& note) { return have_one_in_common(note.signers, forked->signers); });
    tell_fork(*forked, std::max(same_until(*forked), before != nullptr ? before->checkpoint.size : 0),
              behind);
  }
  if (beyond != nullptr) tell(*beyond, size, behind);
  if (forked != nullptr || beyond != nullptr) return;
  Judged* told = held != nullptr ? held : with(Answer::kUnknown);
  const auto any = [](const Judged&) { return true; };
  if (told == nullptr) told = newest(any, any);
  if (told != nullptr) {
    tell(*told, size, behind);
    return;
  }
  // Nobody signed any of them: why, of the one that says that it is the newest.
  if (copy.notes.empty() || copy.notes.back().checkpoint.size == 0) {
    findings_->add("outside-note-invalid", {},
                   copy.folder.string() +
                       " has no signed checkpoint of any entry, so nothing was compared "
                       "with it" +
                       behind);
    return;
  }
  const OutsideCopy::Note& last = copy.notes.back();
  const std::string name = (copy.folder / last.file).string();
  const std::optional<std::string> text = text_of_note(copy, last);
  const Signed judged = text ? judge_signature(name, *text, last.checkpoint) : Signed{};
  if (judged.refusal) {
    findings_->add(judged.refusal->code, {}, judged.refusal->text + behind);
  } else {
    findings_->add("outside-note-invalid", {}, name + " changed while it was looked at" + behind);
  }
}

}  // namespace kiroku::archive

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

namespace kiroku::archive {

namespace {

Place in_ledger(std::uint64_t entry) { return {std::string(kLedgerFile), entry}; }

bool is_of_a_log(const crypto::Checkpoint& checkpoint) { return checkpoint.origin.ends_with("/log"); }

}  // namespace

OutsideNotes::OutsideNotes(const VerifyOptions& options, FindingList& findings)
    : options_(&options), findings_(&findings) {
  for (const OutsideNote& note : options.against) {
    judge(note);
  }
  for (const OutsideCopy& copy : options.copies) {
    for (const OutsideCopy::Note& note : copy.notes) {
      if (note.checkpoint.size > 0) {
        notes_.push_back({{}, {}, note.checkpoint, false, Signature::kUnjudged, &copy, &note});
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

std::optional<OutsideNotes::Refusal> OutsideNotes::judge_signature(const std::string& name,
                                                                   const std::string& text,
                                                                   const crypto::Checkpoint& checkpoint,
                                                                   bool& alone) const {
  // A device speaks for its own log and cases, never for another's.
  std::vector<crypto::VerifierKey> signers;
  std::copy_if(options_->devices.begin(), options_->devices.end(), std::back_inserter(signers),
               [&](const crypto::VerifierKey& device) { return is_origin_of(checkpoint.origin, device); });
  const crypto::OpenedNote opened = crypto::open_note(text, signers);
  if (opened.failure == crypto::NoteFailure::kUnknownKey) {
    return Refusal{"outside-note-untrusted",
                   name + " is not signed by a trusted device for \"" + checkpoint.origin +
                       "\", so nothing was compared with it: anybody can write such a note"};
  }
  alone = opened.failure == crypto::NoteFailure::kLacksMlDsa ||
          opened.failure == crypto::NoteFailure::kLacksHardware;
  if (opened.failure && !alone) {
    return Refusal{"outside-note-invalid",
                   name + " does not hold, so nothing was compared with it: " + opened.explanation};
  }
  return std::nullopt;
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
  bool alone = false;
  if (const auto refusal = judge_signature(note.name, note.text, *checkpoint, alone)) {
    findings_->add(refusal->code, {}, refusal->text);
    return;
  }
  if (checkpoint->size == 0) {
    findings_->add("outside-note-unchecked", {},
                   note.name + " is of no entry, and everything begins with none, so it was not compared");
    return;
  }
  notes_.push_back({note.name, note.text, std::move(*checkpoint), alone});
}

bool OutsideNotes::is_signed(Judged& note) {
  if (note.signature == Signature::kUnjudged) {
    note.name = (note.copy->folder / note.in_copy->file).string();
    const std::optional<std::string> text = text_of_note(*note.copy, *note.in_copy);
    const bool holds = text && !judge_signature(note.name, *text, note.checkpoint, note.alone);
    note.signature = holds ? Signature::kHolds : Signature::kFails;
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

void OutsideNotes::tell_contradiction(const Judged& one, const Judged& other) {
  contradict_ = contradict_ || (!one.alone && !other.alone);
  add_misfit(one.alone ? one : other, "outside-notes-contradict", {},
             one.name + " and " + other.name + " are both signed by the device for \"" +
                 one.checkpoint.origin + "\" with " + counted(one.checkpoint.size, "entry", "entries") +
                 " and different roots: it signed two histories, whatever is shown now");
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
      if (notes_[j].copy == nullptr && one.origin == other.origin && one.root != other.root) {
        tell_contradiction(notes_[i], notes_[j]);
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
  // Of two that differ one differs from any third. One pair that accuses is enough, and those by all keys do:
  // whatever lies between them.
  const auto tell_two_of = [&](const auto& wanted) {
    const auto in_copy = std::ranges::find_if(
        notes, [&](const Judged* note) { return note->copy != nullptr && wanted(note); });
    if (in_copy == notes.end()) return false;
    const auto other = std::ranges::find_if(
        notes, [&](const Judged* note) { return wanted(note) && differ(note, *in_copy); });
    if (other == notes.end()) return false;
    tell_contradiction(**std::min(in_copy, other), **std::max(in_copy, other));
    return true;
  };
  if (!tell_two_of([](const Judged* note) { return !note->alone; }))
    tell_two_of([](const Judged*) { return true; });
}

void OutsideNotes::reached(std::uint64_t size, const RootTest& fits, bool tree_known) {
  auto each = std::lower_bound(notes_.begin(), notes_.end(), size, [](const Judged& note, std::uint64_t at) {
    return note.checkpoint.size < at;
  });
  std::uint64_t held = held_;
  for (; each != notes_.end() && each->checkpoint.size == size; ++each) {
    if (!tree_known) {
      each->answer = Answer::kUnknown;
    } else if (fits(each->checkpoint.root)) {
      each->answer = Answer::kHolds;
      held = each->alone || each->copy != nullptr ? held : size;
    } else {
      each->answer = Answer::kDiffers;
      each->fork_after = held_;
    }
  }
  held_ = held;
}

bool OutsideNotes::holds_at(std::uint64_t size, const std::string& origin) {
  const auto first =
      std::ranges::lower_bound(notes_, size, {}, [](const Judged& note) { return note.checkpoint.size; });
  for (auto note = first; note != notes_.end() && note->checkpoint.size == size; ++note) {
    if (note->answer == Answer::kHolds && note->checkpoint.origin == origin && is_signed(*note) &&
        !note->alone) {
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
    if (note->answer != Answer::kHolds || !is_asked || !is_signed(*note)) {
      continue;
    }
    if (note->copy == nullptr) {
      held.push_back({note->name, note->text, note->checkpoint});
    } else if (auto text = text_of_note(*note->copy, *note->in_copy)) {
      known.insert(note->copy);
      held.push_back({note->name, std::move(*text), note->checkpoint});
    }
  }
  std::ranges::reverse(held);
  return held;
}

bool OutsideNotes::is_of_what_is_shown(const Judged& note) const {
  return std::ranges::find(origins_, note.checkpoint.origin) != origins_.end();
}

void OutsideNotes::finish(std::uint64_t size, bool whole_ledger) {
  if (std::exchange(finished_, true)) {
    return;
  }
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
  if (origins_.empty()) {
    findings_->add("outside-note-unchecked", {},
                   note.name + " was not compared: what is here does not show whose it is" + behind);
  } else if (!is_of_what_is_shown(note)) {
    findings_->add("outside-note-of-other-origin", {},
                   note.name + " is of \"" + note.checkpoint.origin +
                       "\", which is not what was shown, so it was not compared" + behind);
  } else if (note.answer == Answer::kHolds) {
    findings_->add("outside-note-holds", {},
                   note.name + " holds: the first " + counted(stated, "entry", "entries") +
                       " are those that it was signed of" + behind);
  } else if (note.answer == Answer::kDiffers) {
    add_misfit(note, "outside-note-forked", in_ledger(note.fork_after),
               "the first " + counted(stated, "entry", "entries") + " are not those that " + note.name +
                   " was signed of: the device signed another history, which parts from this one at "
                   "entry " +
                   std::to_string(note.fork_after) + " or later" + behind);
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

// All of its notes bind the device, under whichever names they lie there: the newest one of each answer is
// told. What nobody signed, or was signed for something else, takes none of that back.
void OutsideNotes::finish_copy(const OutsideCopy& copy, std::uint64_t size) {
  const std::string behind = words_of_others(copy);
  std::vector<Judged*> shown, others;  // the newest first
  for (auto note = notes_.rbegin(); note != notes_.rend(); ++note) {
    if (note->copy == &copy) (is_of_what_is_shown(*note) ? shown : others).push_back(&*note);
  }
  const auto newest = [&](const std::vector<Judged*>& notes, const auto& wanted) {
    const auto by = [&](bool may_be_alone) {
      const auto found = std::ranges::find_if(notes, [&](Judged* note) {
        return wanted(*note) && is_signed(*note) && (may_be_alone || !note->alone);
      });
      return found == notes.end() ? nullptr : *found;
    };
    Judged* const accusing = by(false);
    return accusing != nullptr ? accusing : by(true);
  };
  const auto with = [&](Answer answer) {
    return newest(shown, [&](const Judged& note) { return note.answer == answer; });
  };
  Judged* const held = with(Answer::kHolds);
  Judged* const forked = with(Answer::kDiffers);
  Judged* const beyond = with(Answer::kNotReached);
  if (forked != nullptr) {
    const Judged* const before = newest(shown, [&](const Judged& note) {
      return note.answer == Answer::kHolds && note.checkpoint.size < forked->checkpoint.size;
    });
    forked->fork_after = std::max(forked->fork_after, before != nullptr ? before->checkpoint.size : 0);
    tell(*forked, size, behind);
  }
  if (beyond != nullptr) tell(*beyond, size, behind);
  if (forked != nullptr || beyond != nullptr) return;
  Judged* told = held != nullptr ? held : with(Answer::kUnknown);
  if (told == nullptr) told = newest(others, [](const Judged&) { return true; });
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
  bool alone = false;
  const auto refusal = text ? judge_signature(name, *text, last.checkpoint, alone) : std::nullopt;
  if (refusal) {
    findings_->add(refusal->code, {}, refusal->text + behind);
  } else {
    findings_->add("outside-note-invalid", {}, name + " changed while it was looked at" + behind);
  }
}

}  // namespace kiroku::archive

#include "archive/verify/outside_notes.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>

#include "archive/format/case_layout.h"
#include "base/number_text.h"

namespace kiroku::archive {

namespace {

Place in_ledger(std::uint64_t entry) { return {std::string(kLedgerFile), entry}; }

/// Whether an origin is one of a ledger that the device signs: its log's, or that of one of its cases.
bool is_origin_of(const std::string& origin, const crypto::VerifierKey& device) {
  const std::string prefix = case_origin(device.name(), "");
  return origin == log_origin(device.name()) ||
         (origin.starts_with(prefix) && is_case_id(std::string_view(origin).substr(prefix.size())));
}

}  // namespace

OutsideNotes::OutsideNotes(const VerifyOptions& options, FindingList& findings)
    : options_(&options), findings_(&findings) {
  for (const OutsideNote& note : options.against) {
    judge(note);
  }
  std::stable_sort(notes_.begin(), notes_.end(),
                   [](const Judged& a, const Judged& b) { return a.checkpoint.size < b.checkpoint.size; });
  compare_with_each_other();
}

VerifyOptions with_notes_of_logs(const VerifyOptions& options, bool of_logs) {
  constexpr std::string_view kEndOfLogs = "/log";
  VerifyOptions chosen = options;
  std::erase_if(chosen.against, [&](const OutsideNote& note) {
    const auto checkpoint = crypto::Checkpoint::parse(crypto::open_note(note.text, {}).text);
    return (checkpoint && checkpoint->origin.ends_with(kEndOfLogs)) != of_logs;
  });
  return chosen;
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
  // A device speaks for its own log and cases, never for another's.
  std::vector<crypto::VerifierKey> signers;
  std::copy_if(options_->devices.begin(), options_->devices.end(), std::back_inserter(signers),
               [&](const crypto::VerifierKey& device) { return is_origin_of(checkpoint->origin, device); });
  const crypto::OpenedNote opened = crypto::open_note(note.text, signers);
  if (opened.failure == crypto::NoteFailure::kUnknownKey) {
    findings_->add("outside-note-untrusted", {},
                   note.name + " is not signed by a trusted device for \"" + checkpoint->origin +
                       "\", so nothing was compared with it: anybody can write such a note");
    return;
  }
  const bool alone = opened.failure == crypto::NoteFailure::kLacksMlDsa ||
                     opened.failure == crypto::NoteFailure::kLacksHardware;
  if (opened.failure && !alone) {
    findings_->add("outside-note-invalid", {},
                   note.name + " does not hold, so nothing was compared with it: " + opened.explanation);
    return;
  }
  if (checkpoint->size == 0) {
    findings_->add("outside-note-unchecked", {},
                   note.name + " is of no entry, and everything begins with none, so it was not compared");
    return;
  }
  notes_.push_back({note.name, note.text, std::move(*checkpoint), alone});
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

void OutsideNotes::compare_with_each_other() {
  for (std::size_t i = 0; i < notes_.size(); ++i) {
    for (std::size_t j = i + 1; j < notes_.size() && notes_[j].checkpoint.size == notes_[i].checkpoint.size;
         ++j) {
      const crypto::Checkpoint& one = notes_[i].checkpoint;
      const crypto::Checkpoint& other = notes_[j].checkpoint;
      if (one.origin != other.origin || one.root == other.root) {
        continue;
      }
      contradict_ = contradict_ || (!notes_[i].alone && !notes_[j].alone);
      add_misfit(notes_[i].alone ? notes_[i] : notes_[j], "outside-notes-contradict", {},
                 notes_[i].name + " and " + notes_[j].name + " are both signed by the device for \"" +
                     one.origin + "\" with " + counted(one.size, "entry", "entries") +
                     " and different roots: it signed two histories, whatever is shown now");
    }
  }
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
      held = each->alone ? held : size;
    } else {
      each->answer = Answer::kDiffers;
      each->fork_after = held_;
    }
  }
  held_ = held;
}

bool OutsideNotes::holds_at(std::uint64_t size, const std::string& origin) const {
  const auto first =
      std::ranges::lower_bound(notes_, size, {}, [](const Judged& note) { return note.checkpoint.size; });
  for (auto note = first; note != notes_.end() && note->checkpoint.size == size; ++note) {
    if (note->answer == Answer::kHolds && !note->alone && note->checkpoint.origin == origin) {
      return true;
    }
  }
  return false;
}

std::vector<OutsideNotes::Held> OutsideNotes::held_notes() const {
  std::vector<Held> held;
  for (const Judged& note : notes_) {
    if (note.answer == Answer::kHolds) {
      held.push_back({note.name, note.text, note.checkpoint});
    }
  }
  return held;
}

void OutsideNotes::finish(std::uint64_t size, bool whole_ledger) {
  if (std::exchange(finished_, true)) {
    return;
  }
  for (const Judged& note : notes_) {
    const std::uint64_t stated = note.checkpoint.size;
    if (origins_.empty()) {
      findings_->add("outside-note-unchecked", {},
                     note.name + " was not compared: what is here does not show whose it is");
    } else if (std::find(origins_.begin(), origins_.end(), note.checkpoint.origin) == origins_.end()) {
      findings_->add("outside-note-of-other-origin", {},
                     note.name + " is of \"" + note.checkpoint.origin +
                         "\", which is not what was shown, so it was not compared");
    } else if (note.answer == Answer::kHolds) {
      findings_->add("outside-note-holds", {},
                     note.name + " holds: the first " + counted(stated, "entry", "entries") +
                         " are those that it was signed of");
    } else if (note.answer == Answer::kDiffers) {
      add_misfit(note, "outside-note-forked", in_ledger(note.fork_after),
                 "the first " + counted(stated, "entry", "entries") + " are not those that " + note.name +
                     " was signed of: the device signed another history, which parts from this one at "
                     "entry " +
                     std::to_string(note.fork_after) + " or later");
    } else if (note.answer == Answer::kNotReached && whole_ledger) {
      add_misfit(note, "outside-note-rolled-back", in_ledger(size),
                 note.name + " was signed of " + counted(stated, "entry", "entries") + " and there are " +
                     std::to_string(size) + ": the last " + counted(stated - size, "entry", "entries") +
                     " were removed, or this is a copy from before");
    } else {
      findings_->add("outside-note-unchecked", {},
                     note.name + " was signed of " + counted(stated, "entry", "entries") +
                         ", and what is here does not show the root at that size, so it was not compared");
    }
  }
}

}  // namespace kiroku::archive

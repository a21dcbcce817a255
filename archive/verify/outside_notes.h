// Checkpoints that somebody kept outside the machine, against the lines that are shown now: whoever holds the
// device's key can cut off a ledger's end or write another one, and sign that; what they cannot do is take
// back a note that was seen (docs/reference/format.md, "Notes kept outside"). Not thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/verify_options.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

/// What is trusted is VerifyOptions::devices alone: nothing in the folder to be judged says who may have
/// signed a note, or what it is of, beyond the lines whose root is compared.
class OutsideNotes {
 public:
  /// Judges the notes by themselves, and against each other. Everything referred to must outlive the object.
  OutsideNotes(const VerifyOptions& options, FindingList& findings);

  /// The ledger that is walked has this origin; a log whose device was exchanged has several. Notes of any
  /// other are findings in finish().
  void add_origin(const std::string& origin) { origins_.push_back(origin); }
  /// The tree has `size` entries, from 0 on, in rising order, and `fits` tells whether a root is its. Without
  /// `tree_known` that cannot be told.
  void reached(std::uint64_t size, const RootTest& fits, bool tree_known);
  /// Answers for each note, once. The ledger ends with `size` entries. A part of a ledger does not show
  /// whether it goes on.
  void finish(std::uint64_t size, bool whole_ledger);

  /// The largest size so far at which one of them holds; 0 where none does.
  [[nodiscard]] std::uint64_t held() const { return held_; }

  /// Whether one of this size and origin holds, as far as the walk has come.
  [[nodiscard]] bool holds_at(std::uint64_t size, const std::string& origin) const;

  /// Those that hold, as far as the walk has come, by size: their signers' cosignatures count.
  struct Held {
    std::string name, text;
    crypto::Checkpoint checkpoint;
  };
  [[nodiscard]] std::vector<Held> held_notes() const;

  /// Whether two of them prove a fork, whatever the ledger holds.
  [[nodiscard]] bool contradict_each_other() const { return contradict_; }

 private:
  enum class Answer { kNotReached, kHolds, kDiffers, kUnknown };
  struct Judged {
    std::string name, text;
    crypto::Checkpoint checkpoint;
    bool alone = false;  // not by all keys that the device is known to have: it accuses nobody
    Answer answer = Answer::kNotReached;
    std::uint64_t fork_after = 0;  // where it differs: entries that are still those of an older note
  };
  void judge(const OutsideNote& note);
  void compare_with_each_other();
  void add_misfit(const Judged& note, CodeName code, const Place& place, const std::string& text);

  const VerifyOptions* options_;
  FindingList* findings_;
  std::vector<Judged> notes_;  // by size
  std::vector<std::string> origins_;
  std::uint64_t held_ = 0;  // largest size of a note that holds
  bool contradict_ = false;
  bool finished_ = false;
};

/// The options with those of their notes that are of an appliance log, or with the others.
VerifyOptions with_notes_of_logs(const VerifyOptions& options, bool of_logs);

}  // namespace kiroku::archive

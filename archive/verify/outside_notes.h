// Checkpoints that somebody kept outside the machine, against the lines that are shown now: whoever holds the
// device's key can cut off a ledger's end or write another one, and sign that; what they cannot do is take
// back a note that was seen (docs/reference/format.md, "Notes kept outside"). Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
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
  /// Judges the notes by themselves, and against each other; of copies all notes. Everything referred to must
  /// outlive the object.
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

  /// Whether one of this size and origin holds, as far as the walk has come.
  [[nodiscard]] bool holds_at(std::uint64_t size, const std::string& origin);

  /// Those that hold, as far as the walk has come, by size: their signers' cosignatures count. Of a copy its
  /// newest one.
  struct Held {
    std::string name, text;
    crypto::Checkpoint checkpoint;
  };
  [[nodiscard]] std::vector<Held> held_notes();

  /// Whether two of them prove a fork, whatever the ledger holds.
  [[nodiscard]] bool contradict_each_other() const { return contradict_; }

 private:
  enum class Answer { kNotReached, kHolds, kDiffers, kUnknown };
  enum class Signature { kUnjudged, kHolds, kFails };
  struct Judged {
    std::string name, text;  // of a copy's note empty: it is read again where its signature is asked for
    crypto::Checkpoint checkpoint;
    bool alone = false;  // not by all keys that the device is known to have: it accuses nobody
    Signature signature = Signature::kHolds;
    const OutsideCopy* copy = nullptr;  // null: the note was given by itself
    const OutsideCopy::Note* in_copy = nullptr;
    Answer answer = Answer::kNotReached;
    std::uint64_t fork_after = 0;  // where it differs: entries that are still those of an older note
  };
  /// By the devices that may sign for its origin: why it says nothing, in a finding; nothing where it holds.
  struct Refusal {
    CodeName code;
    std::string text;
  };
  [[nodiscard]] std::optional<Refusal> judge_signature(const std::string& name, const std::string& text,
                                                       const crypto::Checkpoint& checkpoint,
                                                       bool& alone) const;
  void judge(const OutsideNote& note);
  /// Whether a trusted device signed it. Of a copy, which may have as many notes as a log has entries, only
  /// those are judged that something rests on.
  bool is_signed(Judged& note);
  void compare_with_each_other();
  /// Two of one origin, of which one at least is in a copy.
  void compare_at_one_size(std::vector<Judged*> notes);
  void tell_contradiction(const Judged& one, const Judged& other);
  void finish_copy(const OutsideCopy& copy, std::uint64_t size);
  void tell(const Judged& note, std::uint64_t size, const std::string& behind);
  void add_misfit(const Judged& note, CodeName code, const Place& place, const std::string& text);
  [[nodiscard]] bool is_of_what_is_shown(const Judged& note) const;

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

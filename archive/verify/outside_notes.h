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
/// signed a note, or what it is of, beyond the lines whose root is compared. A device is one key: several
/// trusted ones may have one name, and what one of them signed says nothing of what another one did.
class OutsideNotes {
 public:
  /// Judges the notes by themselves, and against each other; of copies all notes. Everything referred to must
  /// outlive the object, and the devices stay as they are.
  OutsideNotes(const VerifyOptions& options, FindingList& findings);
  OutsideNotes(const OutsideNotes&) = delete;
  OutsideNotes& operator=(const OutsideNotes&) = delete;

  /// The ledger that is walked is this device's, and has this origin; a log that several devices signed has
  /// several. Notes of any other, and those by another key of its name, are findings in finish().
  void add_shown(const std::string& origin, const crypto::VerifierKey& device);
  /// The tree has `size` entries, from 0 on, in rising order, and `fits` tells whether a root is its. Without
  /// `tree_known` that cannot be told.
  void reached(std::uint64_t size, const RootTest& fits, bool tree_known);
  /// Answers for each note, once. The ledger ends with `size` entries. A part of a ledger does not show
  /// whether it goes on.
  void finish(std::uint64_t size, bool whole_ledger);

  /// Whether one of this size holds, as far as the walk has come, that this device signed for its log.
  [[nodiscard]] bool holds_at(std::uint64_t size, const crypto::VerifierKey& device);

  /// Those that hold, as far as the walk has come, by size: their signers' cosignatures count. Of a copy its
  /// newest one.
  struct Held {
    std::string name, text;
    crypto::Checkpoint checkpoint;
    std::vector<crypto::VerifierKey> signers;  // trusted ones
  };
  [[nodiscard]] std::vector<Held> held_notes();

  /// Whether two of them prove a fork, whatever the ledger holds: by a key of what is shown, as far as that
  /// is known.
  [[nodiscard]] bool contradict_each_other() const;

 private:
  enum class Answer { kNotReached, kHolds, kDiffers, kUnknown };
  enum class Signature { kUnjudged, kHolds, kFails };
  struct Judged {
    std::string name, text;  // of a copy's note empty: it is read again where its signature is asked for
    crypto::Checkpoint checkpoint;
    bool alone = false;  // not by all keys that the device is known to have: it accuses nobody
    std::vector<const crypto::VerifierKey*> signers = {};  // of the trusted devices; empty: see is_signed()
    Signature signature = Signature::kHolds;
    const OutsideCopy* copy = nullptr;  // null: the note was given by itself
    const OutsideCopy::Note* in_copy = nullptr;
    Answer answer = Answer::kNotReached;
  };
  /// Why a note says nothing, in a finding.
  struct Refusal {
    CodeName code;
    std::string text;
  };
  /// By the devices that may sign for its origin.
  struct Signed {
    std::vector<const crypto::VerifierKey*> by;
    bool alone = false;
    std::optional<Refusal> refusal;
  };
  [[nodiscard]] Signed judge_signature(const std::string& name, const std::string& text,
                                       const crypto::Checkpoint& checkpoint) const;
  void judge(const OutsideNote& note);
  /// Whether a trusted device signed it. Of a copy, which may have as many notes as a log has entries, only
  /// those are judged that something rests on.
  bool is_signed(Judged& note);
  void compare_with_each_other();
  /// Two of one origin, of which one at least is in a copy.
  void compare_at_one_size(std::vector<Judged*> notes);
  /// Two that one key signed.
  struct Contradiction {
    const Judged* one;
    const Judged* other;
    friend bool operator==(const Contradiction&, const Contradiction&) = default;
  };
  [[nodiscard]] bool is_by_what_is_shown(const Contradiction& each) const;
  void tell(const Contradiction& each);
  void finish_copy(const OutsideCopy& copy, std::uint64_t size);
  void tell(const Judged& note, std::uint64_t size, const std::string& behind);
  /// `same`: entries that are still those of an older note.
  void tell_fork(const Judged& note, std::uint64_t same, const std::string& behind);
  void tell_of_another(const Judged& note, const std::string& behind);
  void add_misfit(const Judged& note, CodeName code, const Place& place, const std::string& text);
  /// By the origin that it states, whoever signed it.
  [[nodiscard]] bool has_shown_origin(const Judged& note) const;
  /// By its origin and a key that signed it. Not before is_signed().
  [[nodiscard]] bool is_of_what_is_shown(const Judged& note) const;
  /// How many entries are still those of older notes by one of its keys.
  [[nodiscard]] std::uint64_t same_until(const Judged& note) const;

  const VerifyOptions* options_;
  FindingList* findings_;
  std::vector<Judged> notes_;  // by size
  struct Shown {
    std::string origin;
    crypto::VerifierKey device;
  };
  std::vector<Shown> shown_;
  std::vector<Contradiction> contradictions_;
  bool finished_ = false;
};

/// The options with those of their notes that are of an appliance log, or with the others.
VerifyOptions with_notes_of_logs(const VerifyOptions& options, bool of_logs);

}  // namespace kiroku::archive

// Which moments of a recording are which steps of a plan: by what was marked, or as a person says. Pure
// functions, thread-safe. Case times are nanoseconds of the case clock, plan times seconds since the plan
// began.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "archive/format/ledger_entry.h"

namespace kiroku::compare {

struct PlannedStep {
  std::string name;
  double start_s = 0, duration_s = 0;
  [[nodiscard]] double end_s() const { return start_s + duration_s; }
};

/// A mark of the case's events stream.
struct Mark {
  std::int64_t time_ns = 0;
  std::string text;
  bool operator==(const Mark&) const = default;
};

/// What a moment is known from.
enum class KnownFrom {
  kMark,
  kHand,
  kNextStep,      // nobody said when the step ended; the next one begins here
  kRecordingEnd,  // likewise, and no step follows
};
const char* name_of(KnownFrom from);  // "mark", "hand", "next-step", "recording-end"

/// Where a planned step is in the recording.
struct StepMatch {
  std::size_t step = 0;               // of the planned ones
  archive::Span span;                 // when it was done
  std::vector<archive::Span> pauses;  // within the span, in order, apart
  KnownFrom start_from = KnownFrom::kMark, end_from = KnownFrom::kNextStep;
  std::string mark;  // the text it was found by; "" where a person said so
};

struct StepMatching {
  std::vector<StepMatch> matches;    // in order of time; none overlaps another
  std::vector<std::size_t> missing;  // planned steps that were not found
  std::vector<Mark> repeated;        // marks that name a step which had begun before
  std::vector<Mark> ambiguous;       // marks that name a step, and may say anything of it
  std::vector<Mark> unmatched;       // marks that name no step and end none

  /// The match of a planned step, or null.
  [[nodiscard]] const StepMatch* match_of(std::size_t step) const;
  /// Whether the steps that were found were done in the order they were planned in.
  [[nodiscard]] bool in_planned_order() const;
};

/// A mark begins the step that it names: a text that is the step's name or "step 3", or both (upper and lower
/// case and punctuation count for nothing; the longest name wins). Beside it only "now", "begin", "begins",
/// "start", "starts", "started", "of" and "the" may stand. With "end", "ends", "ended", "done", "finished" or
/// "over" in the place of "begin" or "start" it ends that step instead. One with any other word beside a name
/// may say that it is not begun, and is ambiguous. "pause" alone interrupts the step that runs, "resume",
/// "continue" or "go on" takes it up, "end" or "done" alone ends it. Of steps of the same name the first in
/// the plan is the first in the recording. A step nobody ended lasts until the next one begins, the last
/// until `recording_end_ns`. Marks in any order.
StepMatching match_by_marks(std::span<const PlannedStep> steps, std::span<const Mark> marks,
                            std::int64_t recording_end_ns);

/// Takes what a person said and completes it: ends that were left open (end_ns < start_ns of the span), what
/// is missing, the order. kiroku::UsageError in a sentence where steps are named twice or overlap, one that
/// is not planned is named, or pauses lie outside of their step.
StepMatching match_by_hand(std::span<const PlannedStep> steps, std::vector<StepMatch> said,
                           std::int64_t recording_end_ns);

}  // namespace kiroku::compare

// Where the sound beside pictures is missing, and what is stated of it: the rules alone, from times to gaps,
// without a clock, a thread or a file. For sound from a device of its own; where it fails, pictures go on.
#pragma once

#include <cstdint>
#include <optional>

#include "archive/format/ledger_entry.h"
#include "recorder/segmenter.h"

namespace kiroku::recorder {

/// All times are of the case clock, in nanoseconds. Used by one thread.
class SoundGaps {
 public:
  /// Shorter holes are the jitter of a machine and its sound card; silence fills them. It is also what the
  /// encoder lets sound stray from its time before it corrects it at once.
  static constexpr std::int64_t kSmallestNs = 100'000'000;
  /// A device takes its time to start, and what it holds when the case is closed is not waited for.
  static constexpr std::int64_t kAtEndsNs = 1'000'000'000;
  /// What is missing for long is stated in pieces of this length, so that a power cut leaves no more unsaid.
  static constexpr std::int64_t kPieceNs = 60'000'000'000;

  /// Why what is missing from now on is missing. Without a word it is the signal that is lost.
  void lost(archive::GapCause cause) { cause_ = cause; }
  /// Sound from then on came, behind a hole that comes too soon after many others (GapPace): it is left out,
  /// so that the hole lasts. To be asked once of each piece, before heard().
  bool leaves_out(std::int64_t start_ns);
  /// Sound of that stretch came; what is missing before it.
  std::optional<Gap> heard(std::int64_t start_ns, std::int64_t end_ns);
  /// Pictures of `time_ns` came. A piece of what is missing, where there is a whole one.
  std::optional<Gap> piece_before(std::int64_t time_ns);
  /// What is missing when the case is closed.
  [[nodiscard]] std::optional<Gap> gap_at_close(std::int64_t close_ns) const;

 private:
  [[nodiscard]] bool is_hole_before(std::int64_t start_ns) const;

  std::int64_t until_ns_ = 0;  // what is before was heard, or stated as missing
  bool begun_ = false;         // something was heard, or stated
  archive::GapCause cause_ = archive::GapCause::kSignalLost;
  GapPace pace_;
};

}  // namespace kiroku::recorder

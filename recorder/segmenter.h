// Where a stream of pictures is cut into segments, and what is stated as a gap between them: the rules alone,
// from times to decisions, without a clock, a thread or a file.
//
// A segment ends with the first frame at or after the next whole multiple of the segment duration on the case
// clock, and the next one begins with that frame, so spans join without a hole. It ends early, after its last
// frame, where nothing more can be recorded: the source is lost or silent for long, its pictures change their
// size or pixel format, the disk is full. What follows is a gap until the next frame, or until the end.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>

#include "archive/format/ledger_entry.h"

namespace kiroku::recorder {

/// All times are of the case clock, in nanoseconds.
struct SegmentRules {
  std::chrono::nanoseconds duration;         // of a segment
  std::optional<std::int64_t> end_ns;        // nothing is recorded from then on
  bool timed_by_arrival = true;              // else the source states its own times, and ends where they end
  std::uint64_t largest_bytes = 960U << 20;  // a segment holds at most 1 GiB (docs/reference/format.md)
};

/// Nothing was recorded there.
struct Gap {
  archive::Span span;
  archive::GapCause cause = archive::GapCause::kSignalLost;
};

/// Nothing states why a stream of a case has nothing for so long before `close`.
inline constexpr std::int64_t kLongestUnstatedEndNs = 3'000'000'000;

/// So long may no frame come within a segment; a longer silence ends it. Before the first frame no segment
/// could hold it.
std::int64_t longest_silence_ns(std::chrono::nanoseconds segment_duration, bool after_a_frame);

/// Where a stream stands. Used by one thread.
class Segmenter {
 public:
  explicit Segmenter(SegmentRules rules) : rules_(rules) {}

  // What happens to the stream.

  void segment_began(std::int64_t start_ns);
  /// `interval_ns`: how long a frame is shown, of which kLongestShownNs counts.
  void frame_recorded(std::int64_t time_ns, std::int64_t interval_ns);
  void segment_ended(std::int64_t end_ns) { recorded_until_ns_ = end_ns; }
  /// Nothing is recorded since the end of the last segment. Where something was missing already, its cause
  /// stands.
  void absent(archive::GapCause cause);
  /// A write failed: what was recorded ends at `since_ns`, whatever was missing before.
  void failed(std::int64_t since_ns, archive::GapCause cause);

  // What follows from it.

  /// Whether a frame of `time_ns` comes after so long a silence that the segment ends before it.
  [[nodiscard]] bool silent_before(std::int64_t time_ns, std::int64_t now_ns) const;
  /// Whether the open segment, which holds `bytes`, ends where the frame of `time_ns` begins.
  [[nodiscard]] bool cuts_at(std::int64_t time_ns, std::uint64_t bytes) const;
  /// What is to be stated before a frame of `time_ns` is recorded; nothing is missing then.
  std::optional<Gap> gap_before(std::int64_t time_ns);
  /// What is to be stated when the case is closed. `reached_end`: the source had more at
  /// SegmentRules::end_ns.
  [[nodiscard]] std::optional<Gap> gap_at_close(std::int64_t close_ns, std::int64_t now_ns,
                                                bool reached_end) const;
  /// When the last frame ceased to be shown; 0 before the first. What is stamped at arrival cannot last
  /// beyond `now_ns`, and no frame beyond `next_ns`, before which nothing else is recorded: sources send
  /// faster than the rate they state.
  [[nodiscard]] std::int64_t end_of_last_frame(std::int64_t now_ns,
                                               std::optional<std::int64_t> next_ns = {}) const;
  [[nodiscard]] bool has_frames() const { return last_frame_ns_ >= 0; }
  [[nodiscard]] std::int64_t last_frame_ns() const { return last_frame_ns_; }

 private:
  /// Nothing has been recorded since then.
  struct Absence {
    std::int64_t since_ns = 0;
    archive::GapCause cause = archive::GapCause::kSignalLost;
  };

  SegmentRules rules_;
  std::int64_t boundary_ns_ = 0;
  std::int64_t last_frame_ns_ = -1, interval_ns_ = 0;
  std::int64_t recorded_until_ns_ = 0;  // end of the last segment
  std::optional<Absence> absence_;
};

/// A frame counts as shown for no longer, whatever rate its source states: what follows is silence.
inline constexpr std::int64_t kLongestShownNs = 1'000'000'000;

/// How often something may happen that costs lines of the ledger: so many times within any stretch of such a
/// length. Used by one thread.
class Pace {
 public:
  Pace(std::size_t most, std::int64_t within_ns) : most_(most), within_ns_(within_ns) {}

  /// Nothing where it may happen at `time_ns`, which is counted; else from when on it may. Times never fall.
  std::optional<std::int64_t> refused_until(std::int64_t time_ns);
  /// How many of those that were counted lie within the stretch that ends at `time_ns`.
  [[nodiscard]] std::size_t counted(std::int64_t time_ns) const;

 private:
  std::size_t most_;
  std::int64_t within_ns_;
  std::deque<std::int64_t> times_;  // the latest ones
};

/// How often a source may change its pictures: each change costs an encoder, a file and lines of the ledger.
class ChangePace : public Pace {
 public:
  static constexpr std::size_t kMostChanges = 8;
  static constexpr std::int64_t kWithinNs = 16'000'000'000;
  ChangePace() : Pace(kMostChanges, kWithinNs) {}
};

/// How many holes of a stream are stated: each is a line of the ledger. What comes behind one hole too many
/// is left out, so that the hole lasts until another one may be stated.
class GapPace : public Pace {
 public:
  static constexpr std::size_t kMostGaps = 32;
  static constexpr std::int64_t kWithinNs = 8'000'000'000;
  GapPace() : Pace(kMostGaps, kWithinNs) {}
};

/// The same of what a network loses on the way. No camera of up to 60 pictures a second has more, so that
/// nothing of what comes from it is left out.
class LossPace : public Pace {
 public:
  static constexpr std::size_t kMostGaps = 256;
  LossPace() : Pace(kMostGaps, GapPace::kWithinNs) {}
};

}  // namespace kiroku::recorder

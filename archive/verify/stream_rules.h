// The segments of one stream in order, without overlap, without silent holes (docs/reference/format.md,
// "Verification"). Not thread-safe.
//
// - Indexes count 0, 1, 2 … without hole; an excerpt begins anywhere.
// - A segment begins where the one before it ends, to within kSeamTolerance. If it begins later, the `gap`
//   entries of the stream (before or after it in the ledger) must cover the time between; it never begins
//   earlier.
// - A stream that is recorded as it comes has something, or a gap, from the case's beginning to its end; of
// an
//   excerpt, in all of the time that it states.
// - No gap ends later than both the case and the stream's last segment: that time has not come.
// - No segment with pictures lies wholly in a gap, and none is erased that was never entered.
// - A segment without counts is one that recovery found: a `recovered` stands before it. A recorder leaves
// few.
// - Segments of pictures hold some: without any, one after the other, they are no more than a silence that no
//   recorder states as a gap, and no more of them than gaps account for.
// - Seams add up to little.
// - An incomplete segment is explained by `recovered`, `close` or a `gap` of its stream between the segments
//   around it; one that recovery found, by that.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "archive/format/index_ranges.h"
#include "archive/format/ledger_entry.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/report.h"
#include "archive/verify/segment_times.h"

namespace kiroku::archive {

/// A container's time base can round to milliseconds (Matroska); no picture or sample fits in less.
inline constexpr std::int64_t kSeamToleranceNs = 1'000'000;
/// Seams of segments and gaps add up to no more, less a thousandth of the time that those take: what rounds
/// has segments of a second or more.
inline constexpr std::int64_t kMostInSeamsNs = 100'000'000;
/// A recorder states it as a gap where pictures do not come for longer.
inline constexpr std::int64_t kLongestUntoldBlindnessNs = 5'000'000'000;
/// A recorder states as a gap what lacks for more than 1 s at a case's beginning, and at the moment at which
/// it stops; then it has the rest of its pictures and its last files to write before `close`.
inline constexpr std::int64_t kLateBeginToleranceNs = 2'000'000'000;
inline constexpr std::int64_t kGapBeyondEndToleranceNs = 2'000'000'000;
inline constexpr std::int64_t kEarlyEndToleranceNs = 10'000'000'000;
/// Format 1 has segments of 10 s at most, whatever is in them; the last frame is shown until the next one.
/// Recovery, which does not know when a file that it found ended, takes 10 s at most, too.
inline constexpr std::int64_t kLongestSegmentNs = 11'000'000'000;
/// Monitors send a value a minute, or more often.
inline constexpr std::int64_t kLongestUntoldSilenceNs = 60'000'000'000;

class StreamRules {
 public:
  StreamRules(StreamInfo info, bool whole_case, FindingList& findings);
  /// Of an excerpt whose lines leave none out behind `open`: its segments begin with the first, as a case's.
  void begin_at_open();

  /// False if the segment's file name is not the one its stream and index dictate, so that it must not be
  /// opened; or if an entry before named the same file: it is read once, however often it is named.
  bool take(const SegmentEntry& segment, std::uint64_t entry);
  void take(const GapEntry& gap, std::uint64_t entry);
  void take(const ErasedEntry& erased, std::uint64_t entry);
  /// `recovered` or `close`, which explain an incomplete segment.
  void take_interruption();
  /// `recovered`, after which segments may stand that nobody could count.
  void take_recovered();
  /// Totals of `close` against what was seen: the sums, where all of it was; else no less than what was.
  void check_totals(const StreamTotal* stated, std::uint64_t entry);
  /// `recorded`: from the case's beginning to its `close`, where that was seen.
  /// `lines_begin_ns`: of an excerpt that leaves lines out before its own, the case clock of the first.
  void finish(std::optional<Span> recorded = std::nullopt,
              std::optional<std::int64_t> lines_begin_ns = std::nullopt);

  [[nodiscard]] const std::shared_ptr<const StreamInfo>& info() const { return info_; }
  [[nodiscard]] const StreamReport& report() const { return report_; }
  /// It has something only where somebody did something.
  [[nodiscard]] bool is_of_marks() const { return of_marks_; }
  /// Where its first segment, or a gap before it, begins; nothing of a stream of marks, and where there is
  /// neither.
  [[nodiscard]] std::optional<std::int64_t> first_ns() const;
  [[nodiscard]] bool erased(std::uint64_t index) const;
  /// The file of an erased segment is not there.
  void count_erased() { ++report_.erased_segments; }
  /// What the file of the segment that comes next, or so many later, may be called, complete.
  [[nodiscard]] std::vector<std::string> next_files(std::uint64_t further) const;
  /// Whether a file that no entry names may be a segment that could not be made durable, so that nothing is
  /// claimed of it: a part, or whole, of an index that comes next or later, of a stream whose last word is a
  /// gap.
  [[nodiscard]] bool may_be_left_over(const std::string& path) const;
  /// Whether a segment's file of this stream may be called so, whatever its index.
  [[nodiscard]] bool has_name(const std::string& path) const;
  /// Where an excerpt's lines lie in the case's ledger.
  struct LinesShown {
    std::int64_t begin_ns = 0;                    // case clock of the first
    std::int64_t recorded_from_ns = 0;            // from where on streams must have something
    std::optional<std::int64_t> closed_ns;        // case clock of `close`, where it is among them
    std::optional<std::uint64_t> total_segments;  // of the stream, by `close`
  };
  /// Whether every segment of the stream that meets [from_ns, to_ns) must be among the lines seen. A stream's
  /// segments are entered in the order of their times, so a segment at each end shows it. A gap does not: it
  /// may be entered before a segment that lies before it, or after one that lies behind it.
  [[nodiscard]] bool shows_all_of(std::int64_t from_ns, std::int64_t to_ns, const LinesShown& lines) const;
  /// Demands of the time that an excerpt states what a case must have of all of its: that a stream which is
  /// recorded as it comes has something there, or a gap among the lines. After finish(), where
  /// shows_all_of() holds.
  void check_stated_time(const Span& stated, const LinesShown& lines) const;
  /// How much of [from_ns, to_ns) the stream's gaps take.
  [[nodiscard]] std::int64_t gap_within(std::int64_t from_ns, std::int64_t to_ns) const;
  /// How many segments the case has at least, by the largest index seen.
  [[nodiscard]] std::uint64_t known_segments() const { return next_index_.value_or(0); }

 private:
  struct Hole {
    Span span;
    std::uint64_t entry = 0;
    std::uint64_t index = 0;
  };
  /// What a segment holds against its length.
  struct Filling {
    std::uint64_t entry = 0, index = 0, frames = 0;  // those that were dropped among them: they are stated
    std::int64_t start_ns = 0, duration_ns = 0;
    bool has_pictures = false;  // that were not dropped
    [[nodiscard]] double rate() const { return static_cast<double>(frames) * 1e9 / double(duration_ns); }
  };
  void count_filling(const SegmentEntry& segment, std::uint64_t entry);
  void count_empty(const SegmentEntry& segment, std::uint64_t entry);
  /// How much of the stream's gaps lies in a time: not joined, so that none is longer than it is stated.
  class TimeInGaps {
   public:
    TimeInGaps() = default;
    explicit TimeInGaps(std::vector<Span> gaps);
    [[nodiscard]] const std::vector<Span>& gaps() const { return gaps_; }
    [[nodiscard]] std::int64_t within(const Span& span) const;

   private:
    [[nodiscard]] std::int64_t until(std::int64_t time_ns) const;
    std::vector<Span> gaps_;  // in order, none meets another
    std::vector<std::int64_t> before_;
  };
  /// Demands a gap where segments in a row hold no picture; before join_gaps().
  void check_empty();
  /// Demands that seams add up to little; before join_gaps().
  void check_seams(std::optional<std::int64_t> lines_begin_ns);
  /// Of an excerpt's time: whether nothing but segments without pictures lies in it.
  void check_stated_pictures(const Span& asked) const;
  /// Demands a gap where a stream has nothing at the case's beginning or end.
  void check_ends(const Span& recorded);
  /// Of a stream that was read from a file: tells where, in `asked`, it is shorter than `recorded`.
  void check_length(const Span& recorded, const Span& asked) const;
  void check_gaps_end(const Span& recorded);
  void check_fillings();
  /// Pictures of a time that a gap says was not recorded; gaps must be joined.
  void check_pictures_in_gaps();
  void check_seam(const SegmentEntry& segment, std::uint64_t entry);
  /// Of a segment's file of this stream; nothing for any other path.
  [[nodiscard]] std::optional<std::uint64_t> index_of(const std::string& path) const;
  /// Sorts the gaps and joins those between which no more than the tolerance is missing.
  void join_gaps();
  /// What is left of a hole after all gaps, which must be joined; nothing if they cover it.
  [[nodiscard]] std::optional<Span> uncovered(Span hole) const;

  std::shared_ptr<const StreamInfo> info_;
  StreamReport report_;
  // by what its files hold: whoever holds the device key chooses what a stream is called
  bool of_pictures_, of_marks_;
  bool whole_case_;
  bool from_open_;  // a whole case, or an excerpt that leaves nothing out behind `open`
  FindingList* findings_;
  SegmentTimes times_;
  std::optional<std::uint64_t> first_index_, next_index_;
  IndexRanges entered_, entered_parts_;  // indexes of complete segments and of others
  std::optional<std::int64_t> end_ns_;
  std::vector<Span> gaps_;
  std::optional<Span> all_gaps_;  // from the earliest start to the latest end
  struct StatedGap {
    std::int64_t end_ns = 0;
    std::uint64_t entry = 0;
  };
  std::optional<StatedGap> latest_gap_;  // of pictures or of sound
  std::vector<Hole> holes_;
  std::vector<Filling> fillings_;
  struct Taken {
    Span span;
    std::uint64_t entry = 0;
    bool is_empty = false;  // of pictures, counted, without any
  };
  std::vector<Taken> taken_;  // all segments
  struct Emptiness {
    Span span;
    std::uint64_t entry = 0, index = 0, segments = 0;
  };
  std::vector<Emptiness> empty_;  // segments in a row without a picture
  bool is_empty_now_ = false, told_empty_ = false;
  std::uint64_t found_ = 0;  // segments that nobody counted
  TimeInGaps in_gaps_;
  std::optional<Span> silence_, longest_silence_;  // of samples: segments in a row without one
  IndexRanges erased_;
  struct Cut {
    std::uint64_t entry = 0;
    std::string file;
  };
  std::optional<Cut> cut_;    // an incomplete segment that nothing has explained yet
  bool interrupted_ = false;  // since the last segment
  bool recovered_ = false;
  std::optional<std::uint64_t> first_dropped_entry_;
};

}  // namespace kiroku::archive

// Whether the sealed events of a case are those to which the `mark` entries of its ledger commit
// (docs/reference/format-streams.md, "The events stream"). Only whoever can open the stream sees it.
// take_lines() from any thread, the others from one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/format/ledger_entry.h"
#include "archive/verify/finding_list.h"
#include "base/bytes.h"
#include "base/utc_time.h"
#include "crypto/hash.h"

namespace kiroku::archive {

/// The lines of one events segment, as its plaintext comes.
class EventLines {
 public:
  /// Each piece behind the one before.
  void add(ByteView plaintext);
  /// The segment is whole: what follows its last line is no event. Of one that was cut off it is left out.
  void end();

 private:
  friend class EventMarks;
  struct Event {
    std::optional<crypto::Sha256Digest> commitment;  // nothing: the line is no event
    std::optional<std::int64_t> time_ns;             // that it states
    bool states_utc = false;
    std::optional<UtcTime> utc;  // that it states; nothing where that is none
  };
  void take_line(std::string_view line);

  std::string begun_;  // the line that is not at its end
  bool is_too_long_ = false;
  std::vector<Event> events_;
};

/// What the ledger, or an excerpt's lines, show of the recorder's work.
struct EventsShown {
  /// The recorder came to its end and all of its entries are there: each mark has its event in a segment.
  bool is_whole = false;
  /// Of an excerpt that leaves lines out before its own: the case clock of its first one.
  std::optional<std::int64_t> begins_ns;
  /// Of an excerpt: the time that it is of. Marks of other times have their events elsewhere.
  std::optional<Span> stretch;
};

class EventMarks {
 public:
  /// Of a case with more the first so many are compared, and no mark is said to lack its event.
  static constexpr std::size_t kMostEvents = 1'000'000;
  /// An event is entered within this time after the one that it states: a disk may be slow.
  static constexpr std::int64_t kLatestNs = 5'000'000'000;
  static constexpr std::int64_t kToleranceNs = 1'000'000'000;
  /// An event that a crash left in a segment may lack its entry if it is younger than this against the last
  /// entry before that.
  static constexpr std::int64_t kUnenteredNs = 10'000'000'000;

  /// `open` names a stream of marks.
  void take_stream() { ++streams_; }
  void take_mark(const MarkEntry& mark, const CaseEntry& entry, std::uint64_t number);
  /// The ledger names an events segment, whole or not.
  void take_segment(const SegmentEntry& segment, std::uint64_t number);
  /// A `clock` entry of this time states that the machine's clock was set.
  void take_step(std::int64_t mono_ns) { steps_ns_.push_back(mono_ns); }
  /// `recovered` follows an entry that was written at this time. The first one counts: the recorder died
  /// there.
  void take_recovered(std::int64_t before_ns) { cut_off_ns_ = cut_off_ns_.value_or(before_ns); }
  /// All lines of such a segment, which was opened and fits its hash. From any thread.
  void take_lines(const EventLines& lines, const std::string& file);

  /// Nothing where segments are named and none was opened, nor of an excerpt, or a case without such a
  /// stream, that has none.
  ///
  /// A recorder enters the marks of a segment before the segment, and the segments in the order in which it
  /// sealed them. So, where one stream is of marks, whatever became of the case, a line of a counted segment
  /// has its entry; and if all segments from a mark's entry on to one that ends after it are whole, one of
  /// them has its event.
  void finish(const EventsShown& shown, FindingList& findings);

 private:
  struct Mark {
    crypto::Sha256Digest commitment{};
    std::uint64_t entry = 0;
    std::int64_t mono_ns = 0;
    UtcTime utc;
    bool is_found = false;
    std::size_t found_behind = 0;  // of the first one of a commitment: so many of the same were found
  };
  struct Segment {
    std::string file;
    std::uint64_t entry = 0;
    Span span;
    bool is_complete = false, is_counted = false;
  };
  struct Found {
    EventLines::Event event;
    std::size_t file = 0;  // in files_
  };
  /// The first mark of that commitment whose event was not found yet; `marks_` are in its order.
  [[nodiscard]] Mark* next_of(const crypto::Sha256Digest& commitment);
  /// Whether an entry must commit to this line of a segment, by what is shown.
  [[nodiscard]] bool needs_entry(const EventLines::Event& event, const Segment& segment,
                                 const EventsShown& shown) const;
  void judge_times(const EventLines::Event& event, const Mark& mark, const std::string& file,
                   FindingList& findings) const;
  /// Whether the UTC that an event states is that of its entry, by the time between the two.
  [[nodiscard]] bool has_utc_of(const EventLines::Event& event, const Mark& mark) const;
  void judge_found(const EventsShown& shown, FindingList& findings);
  void judge_marks(const EventsShown& shown, FindingList& findings);

  std::vector<Mark> marks_;
  std::vector<Segment> segments_;       // in the ledger's order
  std::vector<std::int64_t> steps_ns_;  // in the ledger's order
  std::optional<std::int64_t> cut_off_ns_;
  std::size_t streams_ = 0;  // of marks, that `open` names

  std::mutex mutex_;  // guards what follows while workers run
  std::vector<Found> found_;
  std::vector<std::string> files_;
  bool are_too_many_ = false;
};

}  // namespace kiroku::archive

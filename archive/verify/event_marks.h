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
#include "crypto/hash.h"

namespace kiroku::archive {

/// The lines of one events segment, as its plaintext comes.
class EventLines {
 public:
  /// Each piece behind the one before.
  void add(ByteView plaintext);

 private:
  friend class EventMarks;
  struct Event {
    std::optional<crypto::Sha256Digest> commitment;  // nothing: the line is no event
    std::optional<std::int64_t> time_ns;             // that it states
  };
  void take_line(std::string_view line);

  std::string begun_;  // the line that is not at its end
  bool is_too_long_ = false;
  std::vector<Event> events_;
};

class EventMarks {
 public:
  /// Of a case with more the first so many are compared, and no mark is said to lack its event.
  static constexpr std::size_t kMostEvents = 1'000'000;
  /// An event is entered within this time after the one that it states: a disk may be slow.
  static constexpr std::int64_t kLatestNs = 5'000'000'000;
  static constexpr std::int64_t kToleranceNs = 1'000'000'000;

  void take_mark(const MarkEntry& mark, const CaseEntry& entry, std::uint64_t number);
  /// The ledger names an events segment, whole or not.
  void take_segment(const SegmentEntry& segment);
  /// All lines of such a segment, which was opened and fits its hash.
  void take_lines(EventLines lines, const std::string& file);

  /// `is_whole`: all that the recorder entered and wrote is there, by the ledger. Nothing where no segment
  /// was opened.
  void finish(bool is_whole, FindingList& findings);

 private:
  struct Mark {
    crypto::Sha256Digest commitment{};
    std::uint64_t entry = 0;
    std::int64_t mono_ns = 0;
    bool is_found = false;
    std::size_t found_behind = 0;  // of the first one of a commitment: so many of the same were found
  };
  /// The first mark of that commitment whose event was not found yet; `marks_` are in its order.
  [[nodiscard]] Mark* next_of(const crypto::Sha256Digest& commitment);
  struct Found {
    EventLines::Event event;
    std::size_t file = 0;  // in files_
  };

  std::vector<Mark> marks_;
  std::uint64_t segments_ = 0;
  bool is_any_cut_ = false;

  std::mutex mutex_;  // guards what follows while workers run
  std::vector<Found> found_;
  std::vector<std::string> files_;
  bool are_too_many_ = false;
};

}  // namespace kiroku::archive

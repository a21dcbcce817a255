// All rules for the entries of a case, fed line by line, whether from a whole ledger or an excerpt's part of
// one. Knows nothing of where lines come from. Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <unordered_set>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/line_reader.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/event_marks.h"
#include "archive/verify/file_checker.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/report.h"
#include "archive/verify/stream_rules.h"
#include "archive/verify/token_rules.h"
#include "archive/verify/verify_options.h"

namespace kiroku::archive {

class CaseRules {
 public:
  /// What an excerpt leaves out is not looked for: which segments must be there, and no subject.
  struct Scope {
    bool whole_case = true;
    bool from_open = true;                            // no entry behind `open` is left out
    std::uint64_t first_line = 0;                     // of an excerpt: the number of its first line
    std::function<bool(const SegmentEntry&)> wanted;  // unset: all
    std::function<bool(const std::string& file)> rekeyed;
  };
  /// Everything referred to must outlive the object.
  CaseRules(const CaseFolder& folder, const VerifyOptions& options, FindingList& findings,
            CheckpointRules& checkpoints, FileChecker& files, Scope scope);

  /// Before the first take(): is told of marks and of events segments; must outlive the object.
  void compare_events(EventMarks& marks) { marks_ = &marks; }
  /// Entry `number`. Lines that are no entries are findings.
  void take(const LedgerLine& line, std::uint64_t number);
  /// Whether so many lines are no entries that the rest is not worth reading: then nothing may be judged that
  /// depends on it.
  [[nodiscard]] bool gave_up() const { return broken_lines_ > kMostBrokenLines; }
  /// After the last line. `lines_begin_ns`: of an excerpt that leaves lines out before its own, the case
  /// clock of the first.
  void finish(std::optional<std::int64_t> lines_begin_ns = std::nullopt);
  /// Where the case is stated to begin before `open`: whether something is there of an excerpt's time from
  /// `from_ns` on, as finish() asks of a case. After that.
  void judge_pre_roll(std::int64_t from_ns);
  /// After FileChecker::finish(): files that are not there, unless erased.
  void judge_missing(const std::vector<MissingFile>& missing);

  [[nodiscard]] const std::optional<OpenEntry>& opening() const { return opening_; }
  [[nodiscard]] const std::optional<crypto::VerifierKey>& device() const { return device_; }
  [[nodiscard]] std::optional<std::uint64_t> close_entry() const { return close_; }
  [[nodiscard]] std::optional<std::int64_t> closed_ns() const {
    return close_ ? std::optional(closed_ns_) : std::nullopt;
  }
  /// From where on streams that are recorded as they come must have something. With a pre-roll their oldest
  /// segments begin at different times, each before `open`.
  [[nodiscard]] std::int64_t recorded_from_ns() const { return is_pre_rolled() ? opened_ns_ : 0; }
  /// The reason that `close` states; empty before it.
  [[nodiscard]] const std::string& close_reason() const { return close_reason_; }
  /// What `close` states of each stream; empty before it.
  [[nodiscard]] const std::map<std::string, StreamTotal>& close_totals() const { return close_totals_; }
  [[nodiscard]] bool recovered() const { return recovered_; }
  /// Entries up to the last one that somebody must have signed: a token proves itself, and one that was
  /// missed proves nothing.
  [[nodiscard]] std::uint64_t claims() const { return claims_; }
  [[nodiscard]] std::int64_t last_mono_ns() const { return last_mono_ns_; }
  [[nodiscard]] const std::map<std::string, StreamRules>& streams() const { return streams_; }
  [[nodiscard]] const TokenRules& tokens() const { return tokens_; }
  /// Whether each of the entries [first, end), which no checkpoint covers, only tells what became of a closed
  /// case: a late token that says so itself, a missed one, an erasure. Nothing is believed for their sake.
  [[nodiscard]] bool only_aftermath(std::uint64_t first, std::uint64_t end) const;
  /// Whether an entry names this file.
  [[nodiscard]] bool names(const std::string& file) const { return named_.contains(file); }
  /// Whether an entry names this authority: its token, or that there is none.
  [[nodiscard]] bool names_authority(const std::string& name) const { return authorities_.contains(name); }
  /// Whether it is a segment's file that an `erased` entry says is gone.
  [[nodiscard]] bool erased(const std::string& path) const;
  /// The stream in whose folder of segments the path lies; null if in none.
  [[nodiscard]] const StreamRules* stream_of_folder(const std::string& path) const;
  /// Whether format 1 has a folder of this path in this case.
  [[nodiscard]] bool is_folder(const std::string& path) const;
  /// Entry of the last segment that was within the scope.
  [[nodiscard]] std::optional<std::uint64_t> last_checked_segment() const { return last_checked_segment_; }
  /// device.pub against `open`.
  void check_device_file();
  /// Fills what the entries tell of the report.
  void describe(VerificationReport& report) const;

 private:
  /// Of the entries before `recovered` that had no signature when it was written.
  std::string take_signed_late(std::uint64_t recovered);
  void judge_wall_clock();
  /// How much of what is judged no outside token was entered before: when that was recorded, the recorder
  /// alone says.
  void judge_first_stamp();
  void judge_first_stamp_of_excerpt(const StampedToken& first);
  /// Where the first outside token is entered more than a recorder's usual while behind the oldest film.
  void judge_age_at_first_stamp(const StampedToken& first);
  /// Where film is entered behind an outside token that came more than that after it ends.
  void judge_late_entries();
  /// Where found film is longer than the time between the outside tokens around it.
  void judge_found();
  [[nodiscard]] bool is_pre_rolled() const { return opening_ && opening_->begins_ns > 0; }
  /// Whether one of the streams is of more than marks.
  void judge_streams();
  /// The UTC of `close` against that of `open` and the case clock.
  void judge_end(UtcTime closed, std::int64_t mono_ns, std::uint64_t number);
  void say_no_readable_open(const LedgerLine& line);
  void count_broken_line(std::uint64_t number);
  void check_common(const CaseEntry& entry, std::uint64_t number, const LedgerLine& line);
  void take_open(const OpenEntry& open, const CaseEntry& entry, std::uint64_t number);
  /// Whether it is a stream as the format has them, and for anybody.
  void judge_form(const StreamInfo& stream, std::uint64_t number);
  void take_segment(const SegmentEntry& segment, std::uint64_t number);
  /// Of one that is of no marks.
  void take_timed(const SegmentEntry& segment, std::uint64_t number);
  void take_clock(const ClockEntry& clock, std::int64_t mono_ns, std::uint64_t number);
  /// What the latest clock entries state of a slew.
  void report_slew();
  void take_close(const CloseEntry& close, const CaseEntry& entry, std::uint64_t number);
  StreamRules* stream(const std::string& name, std::uint64_t number);

  const CaseFolder* folder_;
  const VerifyOptions* options_;
  FindingList* findings_;
  CheckpointRules* checkpoints_;
  FileChecker* files_;
  EventMarks* marks_ = nullptr;
  Scope scope_;
  TokenRules tokens_;
  std::map<std::string, StreamRules> streams_;
  std::vector<SignedLate> signed_late_;
  std::uint64_t found_segments_ = 0;
  std::optional<OpenEntry> opening_;
  std::optional<crypto::VerifierKey> device_;
  std::optional<UtcTime> opened_, closed_, clock_zero_;
  std::optional<std::uint64_t> close_;
  std::string close_reason_;
  std::map<std::string, StreamTotal> close_totals_;
  std::optional<UtcTime> last_utc_;
  std::unordered_set<std::string> named_;
  std::set<std::string> authorities_;
  std::int64_t last_mono_ns_ = 0, opened_ns_ = 0, closed_ns_ = 0;
  std::int64_t before_ns_ = 0;  // of the entry before the last one
  std::optional<std::uint64_t> first_checked_segment_, last_checked_segment_;
  // Where the oldest segment within the scope begins, of all but those of marks, and of all before each
  // token.
  std::optional<std::int64_t> oldest_timed_ns_, oldest_ns_;
  std::map<std::uint64_t, std::int64_t> oldest_before_token_;
  std::optional<std::int64_t> age_at_first_stamp_ns_, entered_late_ns_;
  struct Ended {
    std::int64_t end_ns = 0;
    std::uint64_t entry = 0;
  };
  std::uint64_t last_token_ = 0;  // the latest entry of a token, whether that holds or not
  // Of segments within the scope, but those of marks, by the token in front of their entries: the one that
  // ended first, and of found ones the one that ended last.
  std::map<std::uint64_t, Ended> ended_first_behind_token_, found_last_behind_token_;
  std::set<std::uint64_t> unsigned_aftermath_;  // missed tokens and erasures behind close
  std::uint64_t claims_ = 0;                    // entries up to the last that is about no token
  std::uint64_t last_claim_ = 0;  // the last entry that says more than what became of the case since
  std::uint64_t broken_lines_ = 0;
  bool recovered_ = false;
  bool clock_step_stated_ = false;
  double stepped_ns_ = 0;  // the wall clock, by all that clock entries state
  struct Slew {
    std::uint64_t entry = 0;    // the first that states it
    std::int64_t rate_ppb = 0;  // the largest that was stated
  };
  std::optional<Slew> slew_;  // by the latest clock entry
  bool said_not_synchronised_ = false;
};

}  // namespace kiroku::archive

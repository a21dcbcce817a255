#include "archive/verify/event_marks.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <set>

#include <nlohmann/json.hpp>

#include "archive/format/case_layout.h"
#include "archive/format/event_line.h"
#include "base/foreign_json.h"
#include "base/number_text.h"

namespace kiroku::archive {

namespace {

std::string seconds_text(std::int64_t time_ns) {
  constexpr double kNsPerSecond = 1e9;
  return number_text(static_cast<double>(time_ns) / kNsPerSecond);
}

}  // namespace

void EventLines::add(ByteView plaintext) {
  std::string_view rest = text_of(plaintext);
  while (!rest.empty()) {
    const std::size_t end = rest.find('\n');
    const std::string_view piece = rest.substr(0, end);
    // Of a line that is none anyway no more is kept.
    is_too_long_ = is_too_long_ || begun_.size() + piece.size() > kLongestEventLine;
    if (!is_too_long_) begun_ += piece;
    if (end == std::string_view::npos) return;
    take_line(is_too_long_ ? std::string_view() : std::string_view(begun_));
    begun_.clear();
    is_too_long_ = false;
    rest.remove_prefix(end + 1);
  }
}

void EventLines::end() {
  if (is_too_long_ || !begun_.empty()) take_line("");
}

void EventLines::take_line(std::string_view line) {
  if (events_.size() > EventMarks::kMostEvents) return;
  Event& taken = events_.emplace_back();
  const std::optional<EventLine> read = parse_event_line(line);
  if (!read) return;
  taken.commitment = read->commitment;
  const nlohmann::json event = parse_foreign_json(read->event);
  if (!event.is_object()) return;
  const auto time = event.find("time_ns");
  if (time == event.end() || !time->is_number_integer()) return;
  const bool is_too_great =
      time->is_number_unsigned() && time->get<std::uint64_t>() > std::uint64_t{INT64_MAX};
  if (!is_too_great) taken.time_ns = time->get<std::int64_t>();
  const auto utc = event.find("utc");
  taken.states_utc = utc != event.end();
  if (taken.states_utc && utc->is_string()) taken.utc = parse_utc(utc->get_ref<const std::string&>());
}

void EventMarks::take_mark(const MarkEntry& mark, const CaseEntry& entry, std::uint64_t number) {
  marks_.push_back({mark.commitment, number, entry.at.mono_ns, entry.at.utc});
}

void EventMarks::take_segment(const SegmentEntry& segment, std::uint64_t number) {
  segments_.push_back({segment.file.file, number, segment.span, segment.complete, segment.counted});
}

void EventMarks::take_lines(const EventLines& lines, const std::string& file) {
  const std::lock_guard guard(mutex_);
  files_.push_back(file);
  for (const EventLines::Event& event : lines.events_) {
    are_too_many_ = are_too_many_ || found_.size() == kMostEvents;
    if (are_too_many_) return;
    found_.push_back({event, files_.size() - 1});
  }
}

EventMarks::Mark* EventMarks::next_of(const crypto::Sha256Digest& commitment) {
  const auto first = std::ranges::lower_bound(marks_, commitment, {}, &Mark::commitment);
  if (first == marks_.end() || first->commitment != commitment) return nullptr;
  const auto at = static_cast<std::size_t>(first - marks_.begin()) + first->found_behind;
  if (at == marks_.size() || marks_[at].commitment != commitment) return nullptr;
  ++first->found_behind;
  return &marks_[at];
}

void EventMarks::finish(const EventsShown& shown, FindingList& findings) {
  // An excerpt need not be of events; of a whole case they are in a segment, where a stream is for them.
  const bool is_any_due = streams_ > 0 && segments_.empty() && !shown.stretch;
  if (files_.empty() && !is_any_due) return;
  std::ranges::stable_sort(marks_, {}, &Mark::commitment);
  std::ranges::sort(steps_ns_);
  judge_found(shown, findings);
  if (are_too_many_) {
    findings.add("events-not-compared", {files_.back()},
                 "more than " + std::to_string(kMostEvents) +
                     " events are there: the others were not compared with the mark entries, nor these with "
                     "the others");
    return;
  }
  std::ranges::sort(marks_, {}, &Mark::entry);
  judge_marks(shown, findings);
}

bool EventMarks::needs_entry(const EventLines::Event& event, const Segment& segment,
                             const EventsShown& shown) const {
  if (!event.commitment) return true;  // no recorder writes it
  const std::optional<std::int64_t> time = event.time_ns;
  if (!segment.is_counted) {
    const bool was_long_before = time && cut_off_ns_ && *time < *cut_off_ns_ - kUnenteredNs;
    return was_long_before && (!shown.begins_ns || *time >= *shown.begins_ns + kToleranceNs);
  }
  // What a segment holds was entered after it began, whatever it states.
  const std::int64_t entered_ns = std::max(time.value_or(INT64_MIN), segment.span.start_ns);
  return !shown.begins_ns || entered_ns >= *shown.begins_ns + kToleranceNs;
}

void EventMarks::judge_times(const EventLines::Event& event, const Mark& mark, const std::string& file,
                             FindingList& findings) const {
  const std::optional<std::int64_t> time = event.time_ns;
  const bool is_of_its_time =
      time && *time <= mark.mono_ns + kToleranceNs && *time >= mark.mono_ns - kLatestNs;
  if (is_of_its_time && has_utc_of(event, mark)) return;
  const std::string states = !time            ? "states no time"
                             : is_of_its_time ? "states another UTC than the machine's"
                                              : "states " + seconds_text(*time) + " s of the case clock";
  findings.add("event-time-differs", {file},
               file + " holds an event that " + states + ", and its mark entry " +
                   std::to_string(mark.entry) + " was written at " + seconds_text(mark.mono_ns) +
                   " s, by the machine's UTC at " + format_utc(mark.utc));
}

bool EventMarks::has_utc_of(const EventLines::Event& event, const Mark& mark) const {
  if (!event.states_utc) return true;
  if (!event.utc) return false;
  const auto step = std::ranges::lower_bound(steps_ns_, *event.time_ns - kLatestNs);
  if (step != steps_ns_.end() && *step <= mark.mono_ns + kUnenteredNs) return true;
  constexpr std::int64_t kNsPerUs = 1'000;
  const std::int64_t between_us = (mark.utc - *event.utc).count();
  const std::int64_t apart_us = between_us - (mark.mono_ns - *event.time_ns) / kNsPerUs;
  return std::abs(apart_us) <= kLatestNs / kNsPerUs;
}

void EventMarks::judge_found(const EventsShown& shown, FindingList& findings) {
  std::map<std::string_view, const Segment*> segments;
  for (const Segment& segment : segments_) segments.emplace(segment.file, &segment);
  std::size_t not_asked = 0;
  const std::string* first_not_asked = nullptr;
  for (const Found& each : found_) {
    const std::string& file = files_[each.file];
    Mark* const mark = each.event.commitment ? next_of(*each.event.commitment) : nullptr;
    const auto segment = segments.find(file);
    if (mark == nullptr && segment != segments.end() && !needs_entry(each.event, *segment->second, shown)) {
      ++not_asked;
      first_not_asked = first_not_asked == nullptr ? &file : first_not_asked;
      continue;
    }
    if (mark == nullptr) {
      findings.add("event-not-committed", {file},
                   file +
                       " holds a line to which no mark entry of the ledger commits: it is no event of the "
                       "case");
      continue;
    }
    mark->is_found = true;
    judge_times(each.event, *mark, file, findings);
  }
  if (not_asked == 0) return;
  findings.add(
      "events-not-compared", {*first_not_asked},
      "no mark entry commits to " + std::to_string(not_asked) + " of the events, the first in " +
          *first_not_asked + ", and nobody can tell whether that is as it should be: " +
          (shown.begins_ns ? "their entries would stand before the lines of the excerpt, or recording "
                             "was cut off before they were entered"
                           : "recording was cut off before they had to be entered"));
}

void EventMarks::judge_marks(const EventsShown& shown, FindingList& findings) {
  const std::size_t count = segments_.size();
  std::vector<std::size_t> lacking(count + 1);  // how many of the first so many were not whole, or not opened
  std::vector<std::int64_t> ends(count);        // the latest of the first so many, and one more
  const std::set<std::string_view> opened(files_.begin(), files_.end());
  for (std::size_t i = 0; i < count; ++i) {
    const Segment& each = segments_[i];
    const bool is_there = each.is_complete && each.is_counted && opened.contains(each.file);
    lacking[i + 1] = lacking[i] + (is_there ? 0 : 1);
    ends[i] = i == 0 ? each.span.end_ns : std::max(ends[i - 1], each.span.end_ns);
  }
  std::size_t not_asked = 0;
  std::uint64_t first_not_asked = 0;
  for (const Mark& mark : marks_) {
    if (mark.is_found) continue;
    const auto first = std::ranges::upper_bound(segments_, mark.entry, {}, &Segment::entry);
    const auto last = std::ranges::lower_bound(ends, mark.mono_ns + kToleranceNs);
    const auto from = static_cast<std::size_t>(first - segments_.begin());
    const auto to = static_cast<std::size_t>(last - ends.begin());
    const bool must_be_there =
        (shown.is_whole && lacking[count] == 0) ||
        (streams_ <= 1 && from <= to && to < count && lacking[to + 1] == lacking[from]);
    if (must_be_there) {
      findings.add("event-missing", {std::string(kLedgerFile), mark.entry},
                   "the mark entry " + std::to_string(mark.entry) +
                       " commits to an event that no sealed events segment holds");
    } else if (!shown.stretch || (mark.mono_ns >= shown.stretch->start_ns + kLatestNs &&
                                  mark.mono_ns < shown.stretch->end_ns)) {
      first_not_asked = not_asked++ == 0 ? mark.entry : first_not_asked;
    }
  }
  if (not_asked == 0) return;
  findings.add("events-not-compared", {std::string(kLedgerFile), first_not_asked},
               "no segment that was opened holds the event of " + std::to_string(not_asked) +
                   (not_asked == 1 ? " mark entry, " : " mark entries, the first of them ") +
                   std::to_string(first_not_asked) + ", and none that must hold it is there whole");
}

}  // namespace kiroku::archive

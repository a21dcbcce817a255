#include "archive/verify/event_marks.h"

#include <algorithm>
#include <utility>

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
}

void EventMarks::take_mark(const MarkEntry& mark, const CaseEntry& entry, std::uint64_t number) {
  marks_.push_back({mark.commitment, number, entry.at.mono_ns});
}

void EventMarks::take_segment(const SegmentEntry& segment) {
  ++segments_;
  is_any_cut_ = is_any_cut_ || !segment.complete;
}

void EventMarks::take_lines(EventLines lines, const std::string& file) {
  if (lines.is_too_long_ || !lines.begun_.empty()) lines.take_line("");
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

void EventMarks::finish(bool is_whole, FindingList& findings) {
  if (files_.empty()) return;
  std::ranges::stable_sort(marks_, {}, &Mark::commitment);
  for (const Found& each : found_) {
    const std::string& file = files_[each.file];
    Mark* const mark = each.event.commitment ? next_of(*each.event.commitment) : nullptr;
    if (mark == nullptr) {
      if (is_whole) {
        findings.add("event-not-committed", {file},
                     file +
                         " holds a line to which no mark entry of the ledger commits: it is no event of the "
                         "case");
      }
      continue;
    }
    mark->is_found = true;
    const std::optional<std::int64_t> time = each.event.time_ns;
    if (!time || *time > mark->mono_ns + kToleranceNs || *time < mark->mono_ns - kLatestNs) {
      findings.add("event-time-differs", {file},
                   file + " holds an event that " +
                       (time ? "states " + seconds_text(*time) + " s of the case clock" : "states no time") +
                       ", and its mark entry " + std::to_string(mark->entry) + " was written at " +
                       seconds_text(mark->mono_ns) + " s");
    }
  }
  if (!is_whole || is_any_cut_ || are_too_many_ || files_.size() != segments_) return;
  std::ranges::sort(marks_, {}, &Mark::entry);
  for (const Mark& mark : marks_) {
    if (mark.is_found) continue;
    findings.add("event-missing", {std::string(kLedgerFile), mark.entry},
                 "the mark entry " + std::to_string(mark.entry) +
                     " commits to an event that no sealed events segment holds");
  }
}

}  // namespace kiroku::archive

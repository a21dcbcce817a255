#include "archive/stream_rules.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "archive/case_layout.h"

namespace kiroku::archive {

namespace {

std::string digits(std::uint64_t number) { return std::to_string(number); }

std::string in_seconds(std::int64_t ns) {
  constexpr std::int64_t kNsPerUs = 1'000;
  constexpr std::int64_t kUsPerSecond = 1'000'000;
  const std::int64_t us = ns / kNsPerUs;
  std::string fraction = std::to_string(us % kUsPerSecond);
  fraction.insert(0, 6 - fraction.size(), '0');
  return std::to_string(us / kUsPerSecond) + "." + fraction;
}

std::string text_of(const Span& span) {
  return in_seconds(span.start_ns) + " s to " + in_seconds(span.end_ns) + " s";
}

std::string totals_text(const StreamTotal& total) {
  return digits(total.segments) + " segments, " + digits(total.frames) + " frames, " + digits(total.dropped) +
         " dropped, " + digits(total.bytes) + " bytes";
}

}  // namespace

StreamRules::StreamRules(StreamInfo info, bool whole_case, FindingList& findings)
    : whole_case_(whole_case), findings_(&findings) {
  report_.info = std::move(info);
  if (whole_case_) {
    next_index_ = 0;
  }
}

bool StreamRules::take(const SegmentEntry& segment, std::uint64_t entry) {
  const std::string& name = report_.info.name;
  const Place place{segment.file.file, entry};
  std::string file = segment_path(name, segment.index, report_.info.extension);
  if (!segment.complete) {
    file += kPartSuffix;
  }
  const bool named = segment.file.file == file;
  if (!named) {
    findings_->add(
        "segment-name-differs", {std::string(kLedgerFile), entry},
        "entry " + digits(entry) + " names a file \"" + segment.file.file + "\" where " + file + " must be");
  }
  if (next_index_ && segment.index != *next_index_) {
    findings_->add("segment-out-of-order", place,
                   "entry " + digits(entry) + " has segment " + digits(segment.index) + " of " + name +
                       " where " + digits(*next_index_) + " must come");
  }
  first_index_ = first_index_.value_or(segment.index);
  next_index_ = segment.index + 1;
  check_seam(segment, entry);

  if (cut_) {
    findings_->add("segment-cut-unexplained", {cut_->file, cut_->entry},
                   cut_->file + " is incomplete, and recording went on as if nothing had happened");
    cut_.reset();
  }
  if (!segment.complete) {
    findings_->add("segment-incomplete", place, segment.file.file + " was cut off before its end");
    if (!interrupted_ && segment.counted) {
      cut_ = Cut{entry, segment.file.file};
    }
  }
  interrupted_ = false;
  if (!segment.counted && recovered_) {
    findings_->add("segment-uncounted", place,
                   segment.file.file +
                       " was found after recording was cut off: its times are estimates, and "
                       "only its recipients can count what is in it");
  } else if (!segment.counted) {
    findings_->add("segment-uncounted-unexplained", place,
                   "entry " + digits(entry) + " does not state what " + segment.file.file +
                       " holds, although recording was not cut off before it");
  }

  if (report_.segments == 0) {
    report_.span.start_ns = segment.span.start_ns;
  }
  ++report_.segments;
  report_.frames += segment.frames;
  report_.dropped += segment.dropped;
  report_.bytes += segment.file.bytes;
  report_.span.end_ns = std::max(report_.span.end_ns, segment.span.end_ns);
  if (segment.dropped > 0 && !first_dropped_entry_) {
    first_dropped_entry_ = entry;
  }
  return named;
}

void StreamRules::check_seam(const SegmentEntry& segment, std::uint64_t entry) {
  if (end_ns_) {
    if (segment.span.start_ns < *end_ns_ - kSeamToleranceNs) {
      findings_->add("segment-overlap", {segment.file.file, entry},
                     "segment " + digits(segment.index) + " of " + report_.info.name + " begins at " +
                         in_seconds(segment.span.start_ns) + " s, before " + in_seconds(*end_ns_) +
                         " s, where the one before it ends");
    } else if (segment.span.start_ns > *end_ns_ + kSeamToleranceNs) {
      holes_.push_back({{*end_ns_, segment.span.start_ns}, entry, segment.index});
    }
  }
  end_ns_ = std::max(end_ns_.value_or(0), segment.span.end_ns);
}

void StreamRules::take(const GapEntry& gap, std::uint64_t entry) {
  findings_->add("gap", {std::string(kLedgerFile), entry},
                 report_.info.name + " was not recorded from " + text_of(gap.span) + " (" +
                     std::string(gap_cause_name(gap.cause)) + ")");
  report_.gap_ns += gap.span.end_ns - gap.span.start_ns;
  take_interruption();
  // Gaps come in order, or nearly: joined, a stream that flickers for hours takes no more room than it must.
  if (!gaps_.empty() && gap.span.start_ns >= gaps_.back().start_ns &&
      gap.span.start_ns <= gaps_.back().end_ns) {
    gaps_.back().end_ns = std::max(gaps_.back().end_ns, gap.span.end_ns);
  } else {
    gaps_.push_back(gap.span);
  }
}

void StreamRules::take(const ErasedEntry& erased, std::uint64_t entry) {
  findings_->add("segments-erased", {std::string(kLedgerFile), entry},
                 digits(erased.last_index - erased.first_index + 1) + " segments of " + report_.info.name +
                     " (" + digits(erased.first_index) + " to " + digits(erased.last_index) +
                     ") were erased by policy: " + erased.policy);
  erased_.push_back(erased);
}

void StreamRules::take_interruption() {
  cut_.reset();
  interrupted_ = true;
}

void StreamRules::take_recovered() {
  recovered_ = true;
  take_interruption();
}

void StreamRules::check_totals(const StreamTotal* stated, std::uint64_t entry) {
  if (!whole_case_) {
    return;
  }
  const StreamTotal real{report_.segments, report_.frames, report_.dropped, report_.bytes};
  const bool same = stated != nullptr && stated->segments == real.segments && stated->frames == real.frames &&
                    stated->dropped == real.dropped && stated->bytes == real.bytes;
  if (!same) {
    findings_->add("totals-differ", {std::string(kLedgerFile), entry},
                   "close states for " + report_.info.name + " " +
                       (stated == nullptr ? std::string("nothing") : totals_text(*stated)) +
                       " where its entries add up to " + totals_text(real));
  }
}

std::optional<Span> StreamRules::uncovered(Span hole) const {
  bool moved = true;
  while (moved && hole.end_ns - hole.start_ns > kSeamToleranceNs) {
    moved = false;
    for (const Span& gap : gaps_) {
      if (gap.start_ns <= hole.start_ns + kSeamToleranceNs && gap.end_ns > hole.start_ns) {
        hole.start_ns = gap.end_ns;
        moved = true;
      }
    }
  }
  return hole.end_ns - hole.start_ns > kSeamToleranceNs ? std::optional(hole) : std::nullopt;
}

void StreamRules::finish() {
  for (const Hole& hole : holes_) {
    if (const std::optional<Span> left = uncovered(hole.span)) {
      findings_->add("segment-hole", {std::string(kLedgerFile), hole.entry},
                     report_.info.name + " has nothing from " + text_of(*left) + ", before segment " +
                         digits(hole.index) + ", and no gap says why");
    }
  }
  if (first_dropped_entry_) {
    findings_->add("frames-dropped", {std::string(kLedgerFile), first_dropped_entry_},
                   digits(report_.dropped) + " frames of " + report_.info.name +
                       " were dropped, first in entry " + digits(*first_dropped_entry_));
  }
}

bool StreamRules::erased(std::uint64_t index) const {
  return std::any_of(erased_.begin(), erased_.end(), [&](const ErasedEntry& each) {
    return each.first_index <= index && index <= each.last_index;
  });
}

std::string StreamRules::next_file(std::uint64_t further) const {
  return segment_path(report_.info.name, next_index_.value_or(0) + further, report_.info.extension);
}

bool StreamRules::may_be_left_over(const std::string& path) const {
  const bool ends_with_gap = std::any_of(gaps_.begin(), gaps_.end(),
                                         [&](const Span& gap) { return gap.end_ns >= end_ns_.value_or(0); });
  if (!ends_with_gap) {
    return false;
  }
  const bool part = path.ends_with(kPartSuffix);
  const std::string whole = part ? path.substr(0, path.size() - kPartSuffix.size()) : path;
  const std::string number = std::filesystem::path(whole).filename().string();
  const std::optional<std::uint64_t> index = parse_index(number.substr(0, number.find('.')));
  return index && *index >= next_index_.value_or(0) &&
         whole == segment_path(report_.info.name, *index, report_.info.extension);
}

bool StreamRules::reaches_over(std::int64_t from_ns, std::int64_t to_ns, bool ends) const {
  // Events have segments only where something was marked: that there are none shows nothing.
  if (report_.info.kind == "events") return true;
  std::optional<std::int64_t> begin = end_ns_ ? std::optional(report_.span.start_ns) : std::nullopt;
  std::int64_t end = end_ns_.value_or(0);
  for (const Span& gap : gaps_) {
    begin = std::min(begin.value_or(gap.start_ns), gap.start_ns);
    end = std::max(end, gap.end_ns);
  }
  const bool from_start = first_index_.value_or(0) == 0 && first_index_;
  const bool begins_in_time = from_start || (begin && *begin <= from_ns);
  const bool ends_in_time = ends || (begin && end >= to_ns);
  return begins_in_time && ends_in_time;
}

}  // namespace kiroku::archive

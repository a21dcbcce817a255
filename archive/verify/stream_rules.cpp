#include "archive/verify/stream_rules.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <numeric>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/format/excerpt_document.h"
#include "archive/format/segment_media.h"
#include "archive/verify/found_files.h"
#include "base/printable.h"
#include "base/saturated_sum.h"

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
    : info_(std::make_shared<const StreamInfo>(std::move(info))),
      of_pictures_(info_->media != kLinesMedia),
      of_marks_(info_->kind == "events" && !of_pictures_),
      whole_case_(whole_case),
      from_open_(whole_case),
      findings_(&findings),
      times_(*info_, findings) {
  report_.info = *info_;
  if (whole_case_) {
    next_index_ = 0;
  }
  interrupted_ = !whole_case_;  // by what an excerpt leaves out, as far as it shows
}

void StreamRules::begin_at_open() {
  from_open_ = true;
  next_index_ = 0;
  interrupted_ = false;
}

bool StreamRules::take(const SegmentEntry& segment, std::uint64_t entry) {
  const std::string& name = report_.info.name;
  const Place place{segment.file.file, entry};
  const std::string file = file_of(report_.info, segment);
  const bool of_pictures = report_.info.kind == "video" || segment.profile.empty();
  const bool named = segment.file.file == file && of_pictures;
  if (!of_pictures) {
    findings_->add("segment-name-differs", {std::string(kLedgerFile), entry},
                   "entry " + digits(entry) + " states a profile of pictures, and " + name + " has none");
  } else if (!named) {
    findings_->add("segment-name-differs", {std::string(kLedgerFile), entry},
                   "entry " + digits(entry) + " names a file " + in_quotation_marks(segment.file.file) +
                       " where " + file + " must be");
  }
  if (next_index_ && segment.index != *next_index_) {
    findings_->add("segment-out-of-order", place,
                   "entry " + digits(entry) + " has segment " + digits(segment.index) + " of " + name +
                       " where " + digits(*next_index_) + " must come");
  }
  first_index_ = first_index_.value_or(segment.index);
  next_index_ = segment.index + 1;
  check_seam(segment, entry);
  if (named) times_.take(segment, entry, interrupted_);

  if (cut_) {
    findings_->add("segment-cut-unexplained", {cut_->file, cut_->entry},
                   cut_->file + " is incomplete, and recording went on as if nothing had happened");
    cut_.reset();
  }
  if (!segment.complete) {
    findings_->add("segment-incomplete", place, segment.file.file + " was cut off before its end");
    if (!interrupted_ && segment.counted) {
      cut_ = Cut{entry, shortened(segment.file.file)};
    }
  }
  interrupted_ = false;
  if (!segment.counted && recovered_) {
    findings_->add("segment-uncounted", place,
                   segment.file.file +
                       " was found after recording was cut off: its times are estimates, and "
                       "only its recipients can count what is in it");
  } else if (!segment.counted && !from_open_) {
    findings_->add("excerpt-range-short", {std::string(kExcerptLinesFile), entry},
                   "the lines do not show why nobody counted what " + segment.file.file + " holds");
  } else if (!segment.counted) {
    findings_->add("segment-uncounted-unexplained", place,
                   "entry " + digits(entry) + " does not state what " + segment.file.file +
                       " holds, although recording was not cut off before it");
  }

  if (report_.segments == 0) {
    report_.span.start_ns = segment.span.start_ns;
  }
  ++report_.segments;
  report_.frames = saturated_sum(report_.frames, segment.frames);
  report_.dropped = saturated_sum(report_.dropped, segment.dropped);
  report_.bytes = saturated_sum(report_.bytes, segment.file.bytes);
  report_.span.end_ns = std::max(report_.span.end_ns, segment.span.end_ns);
  count_empty(segment, entry);
  count_filling(segment, entry);
  if (segment.dropped > 0 && !first_dropped_entry_) {
    first_dropped_entry_ = entry;
  }
  IndexRanges& entered = segment.complete ? entered_ : entered_parts_;
  if (!named || entered.contains(segment.index)) {
    return false;  // a finding already: another name, or out of order
  }
  entered.add(segment.index, segment.index);
  return true;
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
  if (!latest_gap_ || gap.span.end_ns > latest_gap_->end_ns) latest_gap_ = {gap.span.end_ns, entry};
  if (gap.of_sound) {
    // It excuses no hole between segments, and no segment that was cut off.
    findings_->add("sound-gap", {std::string(kLedgerFile), entry},
                   "the sound of " + report_.info.name + " was not recorded from " + text_of(gap.span) +
                       " (" + std::string(gap_cause_name(gap.cause)) + ")");
    return;
  }
  findings_->add("gap", {std::string(kLedgerFile), entry},
                 report_.info.name + " was not recorded from " + text_of(gap.span) + " (" +
                     std::string(gap_cause_name(gap.cause)) + ")");
  // Gaps that overlap, as somebody may state them, can add up to more than a number holds.
  const std::int64_t gap_ns = gap.span.end_ns - gap.span.start_ns;
  report_.gap_ns = gap_ns > INT64_MAX - report_.gap_ns ? INT64_MAX : report_.gap_ns + gap_ns;
  take_interruption();
  all_gaps_ = {std::min(all_gaps_.value_or(gap.span).start_ns, gap.span.start_ns),
               std::max(all_gaps_.value_or(gap.span).end_ns, gap.span.end_ns)};
  // Gaps come in order, or nearly: joined, a stream that flickers for hours takes no more room than it must.
  if (!gaps_.empty() && gap.span.start_ns >= gaps_.back().start_ns &&
      gap.span.start_ns <= gaps_.back().end_ns) {
    gaps_.back().end_ns = std::max(gaps_.back().end_ns, gap.span.end_ns);
  } else {
    gaps_.push_back(gap.span);
  }
}

void StreamRules::take(const ErasedEntry& erased, std::uint64_t entry) {
  erased_.add(erased.first_index, erased.last_index);
  // Behind close no segment comes any more; an excerpt does not show how many there are.
  const std::uint64_t entered = whole_case_ ? next_index_.value_or(0) : erased.last_index + 1;
  if (erased.last_index >= entered) {
    findings_->add("erased-never-recorded", {std::string(kLedgerFile), entry},
                   "entry " + digits(entry) + " says that segments of " + report_.info.name + " up to " +
                       digits(erased.last_index) + " were erased, and the ledger has " + digits(entered) +
                       " of them: what was never recorded was not erased");
  }
  if (erased.first_index >= entered) return;
  const std::uint64_t last = std::min(erased.last_index, entered - 1);
  findings_->add("segments-erased", {std::string(kLedgerFile), entry},
                 digits(last - erased.first_index + 1) + " segments of " + report_.info.name + " (" +
                     digits(erased.first_index) + " to " + digits(last) + ") were erased by the policy " +
                     in_quotation_marks(erased.policy) + ", as the recorder states it");
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
  // Of lines that begin in the midst the indexes tell how many segments there are.
  const std::uint64_t segments =
      from_open_ ? report_.segments : std::max(report_.segments, next_index_.value_or(0));
  const StreamTotal real{segments, report_.frames, report_.dropped, report_.bytes};
  const auto fits = [this](std::uint64_t has, std::uint64_t shown) {
    return from_open_ ? has == shown : has >= shown;
  };
  const bool all_fit = stated != nullptr && fits(stated->segments, real.segments) &&
                       fits(stated->frames, real.frames) && fits(stated->dropped, real.dropped) &&
                       fits(stated->bytes, real.bytes);
  if (!all_fit) {
    findings_->add("totals-differ", {std::string(kLedgerFile), entry},
                   "close states for " + report_.info.name + " " +
                       (stated == nullptr ? std::string("nothing") : totals_text(*stated)) +
                       (from_open_ ? " where its entries add up to " : " where the lines show ") +
                       totals_text(real));
  }
}

std::optional<std::int64_t> StreamRules::first_ns() const {
  if (of_marks_ || (report_.segments == 0 && !all_gaps_)) {
    return {};
  }
  const std::int64_t gap_ns = all_gaps_ ? all_gaps_->start_ns : INT64_MAX;
  return report_.segments == 0 ? gap_ns : std::min(gap_ns, report_.span.start_ns);
}

void StreamRules::join_gaps() {
  std::sort(gaps_.begin(), gaps_.end(), [](const Span& a, const Span& b) { return a.start_ns < b.start_ns; });
  std::vector<Span> joined;
  for (const Span& gap : gaps_) {
    if (joined.empty() || gap.start_ns > joined.back().end_ns + kSeamToleranceNs) {
      joined.push_back(gap);
    } else {
      joined.back().end_ns = std::max(joined.back().end_ns, gap.end_ns);
    }
  }
  gaps_ = std::move(joined);
}

std::optional<Span> StreamRules::uncovered(Span hole) const {
  // The gap in which the hole begins, or within the tolerance before which: no other goes on from there.
  const auto after =
      std::upper_bound(gaps_.begin(), gaps_.end(), hole.start_ns + kSeamToleranceNs,
                       [](std::int64_t start_ns, const Span& gap) { return start_ns < gap.start_ns; });
  if (after != gaps_.begin()) {
    hole.start_ns = std::max(hole.start_ns, std::prev(after)->end_ns);
  }
  return hole.end_ns - hole.start_ns > kSeamToleranceNs ? std::optional(hole) : std::nullopt;
}

void StreamRules::count_filling(const SegmentEntry& segment, std::uint64_t entry) {
  const std::int64_t duration_ns = segment.span.end_ns - segment.span.start_ns;
  if (of_pictures_ && segment.complete && segment.counted && duration_ns > 0) {
    fillings_.push_back({entry, segment.index, segment.frames + segment.dropped, segment.span.start_ns,
                         duration_ns, segment.frames > 0});
  }
  // Recovery bounds whatever it finds; a counted film from a file has the lengths that its file has.
  const bool is_bounded = !segment.counted || (!of_marks_ && info_->timing == "arrival");
  if (is_bounded && duration_ns > kLongestSegmentNs) {
    findings_->add("segment-too-long", {std::string(kLedgerFile), entry},
                   "segment " + digits(segment.index) + " of " + report_.info.name + " lasts " +
                       in_seconds(duration_ns) + " s, which no recorder writes");
  }
  if (of_pictures_ || of_marks_) {
    return;
  }
  if (segment.frames > 0 || !segment.counted) {
    silence_.reset();
    return;
  }
  silence_ = Span{silence_ ? silence_->start_ns : segment.span.start_ns, segment.span.end_ns};
  const auto length_ns = [](const Span& span) { return span.end_ns - span.start_ns; };
  if (!longest_silence_ || length_ns(*silence_) > length_ns(*longest_silence_)) {
    longest_silence_ = silence_;
  }
}

void StreamRules::count_empty(const SegmentEntry& segment, std::uint64_t entry) {
  const bool is_empty = of_pictures_ && segment.counted && segment.frames == 0;
  found_ += segment.counted ? 0U : 1U;
  taken_.push_back({segment.span, entry, is_empty});
  if (is_empty && is_empty_now_) {
    Emptiness& row = empty_.back();
    row.span.end_ns = std::max(row.span.end_ns, segment.span.end_ns);
    ++row.segments;
  } else if (is_empty) {
    empty_.push_back({segment.span, entry, segment.index, 1});
  }
  is_empty_now_ = is_empty;
}

StreamRules::TimeInGaps::TimeInGaps(std::vector<Span> gaps) {
  std::ranges::sort(gaps, {}, &Span::start_ns);
  for (const Span& gap : gaps) {
    if (gaps_.empty() || gap.start_ns > gaps_.back().end_ns) {
      gaps_.push_back(gap);
    } else {
      gaps_.back().end_ns = std::max(gaps_.back().end_ns, gap.end_ns);
    }
  }
  std::int64_t sum_ns = 0;
  for (const Span& gap : gaps_) {
    before_.push_back(sum_ns);
    sum_ns += gap.end_ns - gap.start_ns;
  }
}

std::int64_t StreamRules::TimeInGaps::until(std::int64_t time_ns) const {
  const auto after = std::ranges::upper_bound(gaps_, time_ns, {}, &Span::start_ns);
  if (after == gaps_.begin()) return 0;
  const Span& last = *std::prev(after);
  return before_[static_cast<std::size_t>(std::distance(gaps_.begin(), after)) - 1] +
         std::min(time_ns, last.end_ns) - last.start_ns;
}

std::int64_t StreamRules::TimeInGaps::within(const Span& span) const {
  return std::max<std::int64_t>(0, until(span.end_ns) - until(span.start_ns));
}

// Each segment for itself may be as short as one likes, so they are put together: a minute of segments of a
// second that hold nothing is a minute that is not there.
void StreamRules::check_empty() {
  const bool nothing_else = report_.frames == 0 && found_ == 0;
  const std::int64_t most_ns = nothing_else ? kSeamToleranceNs : kLongestUntoldBlindnessNs;
  std::uint64_t segments = 0;
  std::int64_t all_ns = 0;
  std::int64_t longest_ns = 0;
  const Emptiness* longest = nullptr;
  for (const Emptiness& each : empty_) {
    const std::int64_t lacking_ns = each.span.end_ns - each.span.start_ns - in_gaps_.within(each.span);
    if (lacking_ns <= most_ns) continue;
    segments += each.segments;
    all_ns = lacking_ns > INT64_MAX - all_ns ? INT64_MAX : all_ns + lacking_ns;
    if (longest == nullptr || lacking_ns > longest_ns) {
      longest = &each;
      longest_ns = lacking_ns;
    }
  }
  if (longest == nullptr) return;
  told_empty_ = true;
  findings_->add("segments-empty", {std::string(kLedgerFile), longest->entry},
                 digits(segments) + " segments of " + report_.info.name + " hold no frame, together for " +
                     in_seconds(all_ns) + " s that no gap states, most of it from " + text_of(longest->span) +
                     ", from segment " + digits(longest->index) + " on: there is no film of that time");
}

// Each seam for itself is what a container rounds: an hour of them is an hour.
void StreamRules::check_seams(std::optional<std::int64_t> lines_begin_ns) {
  std::vector<Taken> all = taken_;
  for (const Span& gap : in_gaps_.gaps()) all.push_back({gap});
  std::ranges::stable_sort(all, {}, [](const Taken& each) { return each.span.start_ns; });
  constexpr std::int64_t kForgivenIn = 1'000;
  std::optional<std::int64_t> until_ns;
  std::int64_t first_ns = 0;
  std::int64_t lacking_ns = 0;
  for (const Taken& each : all) {
    const std::int64_t seam_ns = until_ns ? each.span.start_ns - *until_ns : 0;
    const bool is_shown = !lines_begin_ns || each.span.start_ns > *lines_begin_ns + kSeamToleranceNs;
    if (is_shown && seam_ns > 0 && seam_ns <= kSeamToleranceNs) {
      if (lacking_ns == 0) first_ns = *until_ns;
      lacking_ns += seam_ns;
    }
    if (lacking_ns > kMostInSeamsNs) {
      findings_->add("segment-hole",
                     {std::string(kLedgerFile), each.entry > 0 ? std::optional(each.entry) : std::nullopt},
                     report_.info.name + " has seams from " + text_of({first_ns, each.span.start_ns}) +
                         " that add up to " + in_seconds(lacking_ns) +
                         " s, more than rounding leaves, and no gap says why");
      return;
    }
    const std::int64_t more_ns = each.span.end_ns - std::max(until_ns.value_or(0), each.span.start_ns);
    if (more_ns > 0) lacking_ns = std::max<std::int64_t>(0, lacking_ns - more_ns / kForgivenIn);
    until_ns = std::max(until_ns.value_or(0), each.span.end_ns);
  }
}

void StreamRules::check_stated_pictures(const Span& asked) const {
  std::int64_t empty_ns = 0;
  std::optional<std::uint64_t> first_entry;
  for (const Taken& each : taken_) {
    const Span& span = each.span;
    const bool meets =
        span.start_ns < asked.end_ns && std::max(span.end_ns, span.start_ns + 1) > asked.start_ns;
    if (meets && !each.is_empty) return;
    if (!meets) continue;
    const std::int64_t length_ns =
        std::min(span.end_ns, asked.end_ns) - std::max(span.start_ns, asked.start_ns);
    empty_ns = std::min(asked.end_ns - asked.start_ns, empty_ns + std::max<std::int64_t>(0, length_ns));
    if (!first_entry) first_entry = each.entry;
  }
  if (told_empty_ || !first_entry || empty_ns - in_gaps_.within(asked) <= kSeamToleranceNs) return;
  findings_->add("segments-empty", {std::string(kLedgerFile), first_entry},
                 "the segments of " + report_.info.name + " hold no frame from " + text_of(asked) +
                     ", and no gap says why: there is no film of that time");
}

void StreamRules::check_fillings() {
  const bool counted = of_pictures_ ? !fillings_.empty() : !of_marks_ && report_.segments > 0;
  if (counted && report_.frames == 0) {
    findings_->add("segments-sparse", {std::string(kLedgerFile)},
                   "none of the " + digits(report_.segments) + " segments of " + report_.info.name +
                       " holds a " + (of_pictures_ ? "frame" : "sample") + ": what they are of said nothing");
    return;
  }
  if (longest_silence_ && longest_silence_->end_ns - longest_silence_->start_ns > kLongestUntoldSilenceNs) {
    findings_->add("monitor-silent", {std::string(kLedgerFile)},
                   report_.info.name + " holds no sample from " + text_of(*longest_silence_) +
                       ", the longest such time: what it is of said nothing, or did not arrive");
  }
  if (fillings_.empty()) {
    return;
  }
  std::vector<double> rates;
  std::ranges::transform(fillings_, std::back_inserter(rates), &Filling::rate);
  const auto middle = rates.begin() + static_cast<std::ptrdiff_t>(rates.size() / 2);
  std::nth_element(rates.begin(), middle, rates.end());
  const double usual = std::max(*middle, 1.0);  // a second: fewer are seldom of a camera
  constexpr double kNsPerSecond = 1e9;
  constexpr double kMostOfUsual = 0.75;
  const auto lacking = [&](const Filling& each) {
    return usual * double(each.duration_ns) / kNsPerSecond - double(each.frames);
  };
  std::uint64_t sparse = 0;
  double all_lacking = 0;
  bool one_is = false;  // for itself, not only with its neighbours
  const Filling* emptiest = nullptr;
  // Segments that lack pictures one after the other count together: each may be as short as one likes.
  for (auto first = fillings_.begin(); first != fillings_.end();) {
    auto end = first;
    double row_lacking = 0;
    while (end != fillings_.end() && end->rate() <= kMostOfUsual * usual &&
           (end == first ||
            end->start_ns - std::prev(end)->start_ns - std::prev(end)->duration_ns <= kSeamToleranceNs)) {
      row_lacking += lacking(*end++);
    }
    if (end == first) {
      ++first;
      continue;
    }
    for (; first != end; ++first) {
      if (row_lacking <= usual) continue;  // less than a second's pictures
      ++sparse;
      all_lacking += lacking(*first);
      one_is = one_is || lacking(*first) > usual;
      if (emptiest == nullptr || lacking(*first) > lacking(*emptiest)) emptiest = &*first;
    }
  }
  const double all_frames = double(report_.frames) + double(report_.dropped);
  const double all_seconds = std::accumulate(
      fillings_.begin(), fillings_.end(), 0.0,
      [](double sum, const Filling& each) { return sum + double(each.duration_ns) / kNsPerSecond; });
  const bool all_are = all_frames < kMostOfUsual * all_seconds && all_seconds - all_frames > 1;
  if (emptiest != nullptr && (one_is || !all_are)) {
    findings_->add("segments-sparse", {std::string(kLedgerFile), emptiest->entry},
                   digits(sparse) + " of the segments of " + report_.info.name +
                       " hold fewer frames than is usual, together about " +
                       digits(static_cast<std::uint64_t>(all_lacking)) + " fewer; segment " +
                       digits(emptiest->index) + " holds " + digits(emptiest->frames) + " in " +
                       in_seconds(emptiest->duration_ns) +
                       " s. Its source sent less, or what it sent did not arrive");
    return;
  }
  if (all_are) {
    findings_->add("segments-sparse", {std::string(kLedgerFile)},
                   "the segments of " + report_.info.name + " hold " + digits(report_.frames) +
                       " frames in " + digits(static_cast<std::uint64_t>(all_seconds)) +
                       " s, less than one a second. Its source sent no more, or what it sent did not arrive");
  }
}

// Whoever reads the gap believes that there is no film of it.
void StreamRules::check_pictures_in_gaps() {
  std::uint64_t count = 0;
  const Filling* first = nullptr;
  for (const Filling& each : fillings_) {
    if (!each.has_pictures || each.duration_ns <= kSeamToleranceNs) continue;
    const std::int64_t end_ns = each.start_ns + each.duration_ns;
    const auto after =
        std::upper_bound(gaps_.begin(), gaps_.end(), each.start_ns,
                         [](std::int64_t start_ns, const Span& gap) { return start_ns < gap.start_ns; });
    if (after == gaps_.begin() || std::prev(after)->end_ns < end_ns) continue;
    ++count;
    if (first == nullptr) first = &each;
  }
  if (first == nullptr) return;
  findings_->add("segment-within-gap", {std::string(kLedgerFile), first->entry},
                 digits(count) + (count == 1 ? " segment" : " segments") + " of " + report_.info.name +
                     " with pictures, the first of them number " + digits(first->index) + " from " +
                     text_of({first->start_ns, first->start_ns + first->duration_ns}) +
                     ", lie in time that a gap says was not recorded: there are pictures of it");
}

void StreamRules::check_ends(const Span& recorded) {
  if (of_marks_) {
    return;  // has segments only where somebody did something
  }
  const std::string& name = report_.info.name;
  if (report_.segments == 0 && gaps_.empty()) {
    findings_->add("stream-empty", {std::string(kLedgerFile)},
                   name + " has nothing from " + text_of(recorded) + ", the whole case, and no gap says why");
    return;
  }
  if (info_->timing != "arrival") {
    check_length(recorded, recorded);
    return;
  }
  if (report_.segments > 0) {
    const auto late = uncovered({recorded.start_ns, report_.span.start_ns});
    if (late && late->end_ns - late->start_ns > kLateBeginToleranceNs) {
      findings_->add(
          "stream-begins-late", {std::string(kLedgerFile)},
          name + " has nothing from " + text_of(*late) + ", before its first segment, and no gap says why");
    }
  }
  const auto early = uncovered({end_ns_.value_or(recorded.start_ns), recorded.end_ns});
  if (early && early->end_ns - early->start_ns > kEarlyEndToleranceNs) {
    findings_->add(
        "stream-ends-early", {std::string(kLedgerFile)},
        name + " has nothing from " + text_of(*early) + ", where the case was closed, and no gap says why");
  }
}

// A file ends where it ends. Whether it was one rests on the recorder's word, so nobody may take the case's
// length for the stream's.
void StreamRules::check_length(const Span& recorded, const Span& asked) const {
  if (report_.segments == 0) {
    return;
  }
  const std::int64_t last_ns = end_ns_.value_or(recorded.start_ns);
  const bool is_late = report_.span.start_ns - recorded.start_ns > kLateBeginToleranceNs &&
                       asked.start_ns < report_.span.start_ns;
  const bool is_early = recorded.end_ns - last_ns > kEarlyEndToleranceNs && asked.end_ns > last_ns;
  if (is_late || is_early) {
    findings_->add("stream-shorter", {std::string(kLedgerFile)},
                   report_.info.name + ", which was read from " + report_.info.source + ", is from " +
                       text_of({report_.span.start_ns, end_ns_.value_or(report_.span.end_ns)}) +
                       " of a case from " + text_of(recorded));
  }
}

// Whoever adds the gaps up reads from them how much of the operation is missing.
void StreamRules::check_gaps_end(const Span& recorded) {
  const std::int64_t end_ns = std::max(recorded.end_ns, end_ns_.value_or(recorded.end_ns));
  if (!latest_gap_ || latest_gap_->end_ns - end_ns <= kGapBeyondEndToleranceNs) return;
  findings_->add("gap-beyond-end", {std::string(kLedgerFile), latest_gap_->entry},
                 "a gap of " + report_.info.name + " is stated to last until " +
                     in_seconds(latest_gap_->end_ns) + " s, and the case was closed at " +
                     in_seconds(recorded.end_ns) + " s: the length of its gaps is no time of the operation");
}

void StreamRules::finish(std::optional<Span> recorded, std::optional<std::int64_t> lines_begin_ns) {
  if (found_ > kMostFoundSegments && info_->timing == "arrival" && !of_marks_) {
    findings_->add("segments-found-many", {std::string(kLedgerFile)},
                   "recovery is said to have found " + digits(found_) + " segments of " + report_.info.name +
                       ", and a recorder that dies leaves no more than " + digits(kMostFoundSegments));
  }
  in_gaps_ = TimeInGaps(gaps_);
  check_empty();
  check_seams(lines_begin_ns);
  join_gaps();
  if (recorded && whole_case_) check_ends(*recorded);
  if (recorded) check_gaps_end(*recorded);
  check_fillings();
  check_pictures_in_gaps();
  for (const Hole& hole : holes_) {
    const std::optional<Span> left = uncovered(hole.span);
    // A gap may be entered before the segment in front of it, and so before the lines of an excerpt.
    if (left && lines_begin_ns && left->end_ns <= *lines_begin_ns + kSeamToleranceNs) {
      findings_->add("excerpt-range-short", {std::string(kExcerptLinesFile), hole.entry},
                     "the lines do not show why " + report_.info.name + " has nothing from " +
                         text_of(*left) + ", before segment " + digits(hole.index));
    } else if (left) {
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

bool StreamRules::erased(std::uint64_t index) const { return erased_.contains(index); }

std::vector<std::string> StreamRules::next_files(std::uint64_t further) const {
  std::vector<std::string> files;
  for (const std::string& extension : extensions_of(report_.info))
    files.push_back(segment_path(report_.info.name, next_index_.value_or(0) + further, extension));
  return files;
}

bool StreamRules::may_be_left_over(const std::string& path) const {
  if (!all_gaps_ || all_gaps_->end_ns < end_ns_.value_or(0)) {
    return false;
  }
  const bool part = path.ends_with(kPartSuffix);
  const std::string whole = part ? path.substr(0, path.size() - kPartSuffix.size()) : path;
  const std::optional<std::uint64_t> index = index_of(whole);
  return index && *index >= next_index_.value_or(0);
}

bool StreamRules::has_name(const std::string& path) const { return index_of(path).has_value(); }

std::optional<std::uint64_t> StreamRules::index_of(const std::string& path) const {
  const std::string number = std::filesystem::path(path).filename().string();
  const std::optional<std::uint64_t> index = parse_index(number.substr(0, number.find('.')));
  if (!index) return std::nullopt;
  const std::vector<std::string> extensions = extensions_of(report_.info);
  const bool is_its_own = std::ranges::any_of(extensions, [&](const std::string& extension) {
    return path == segment_path(report_.info.name, *index, extension);
  });
  return is_its_own ? index : std::nullopt;
}

bool StreamRules::shows_all_of(std::int64_t from_ns, std::int64_t to_ns, const LinesShown& lines) const {
  if (lines.total_segments == 0U) {
    return true;
  }
  const bool any = first_index_.has_value();
  // What came live was entered after it happened: nothing entered before from_ns lies in the time.
  const bool written_before = report_.info.timing == "arrival" && lines.begin_ns <= from_ns;
  const bool begins_in_time =
      from_open_ || written_before || first_index_ == 0U || (any && report_.span.start_ns <= from_ns);
  return begins_in_time && (lines.closed_ns || (any && end_ns_ >= to_ns));
}

// Between two segments of the lines finish() asks. What a case may lack at its ends is judged by all of it:
// else an excerpt of a few seconds at a time would show none of a long silence.
void StreamRules::check_stated_time(const Span& stated, const LinesShown& lines) const {
  const Span asked{std::max(stated.start_ns, lines.recorded_from_ns),
                   std::min(stated.end_ns, lines.closed_ns.value_or(stated.end_ns))};
  if (of_marks_ || asked.end_ns <= asked.start_ns || asked.end_ns - asked.start_ns <= kSeamToleranceNs) {
    return;
  }
  if (of_pictures_) check_stated_pictures(asked);
  const bool from_first = from_open_ || first_index_ == 0U;
  const Place place{std::string(kExcerptLinesFile)};
  const std::string& name = report_.info.name;
  const auto lacks = [&](const std::optional<Span>& left, std::int64_t tolerance_ns) {
    return left && left->end_ns - left->start_ns > tolerance_ns &&
           std::min(left->end_ns, asked.end_ns) - std::max(left->start_ns, asked.start_ns) > kSeamToleranceNs;
  };
  const auto is_not_shown = [&](const Span& span) {
    findings_->add("excerpt-range-short", place,
                   "the lines do not show why " + name + " has nothing from " + text_of(span));
  };
  if (report_.segments == 0 && gaps_.empty() && from_open_) {
    findings_->add("stream-empty", place,
                   name + " has nothing from " + text_of(asked) + ", nor elsewhere, and no gap says why");
    return;
  }
  if (info_->timing != "arrival") {
    const std::int64_t first_ns = from_first ? lines.recorded_from_ns : report_.span.start_ns;
    check_length({first_ns, lines.closed_ns.value_or(end_ns_.value_or(first_ns))}, asked);
    return;
  }
  if (report_.segments == 0 && !from_open_ &&
      (gaps_.empty() || gaps_.front().start_ns > asked.start_ns + kSeamToleranceNs)) {
    is_not_shown(asked);
    return;
  }
  if (report_.segments > 0) {
    const auto late =
        uncovered({from_first ? lines.recorded_from_ns : asked.start_ns, report_.span.start_ns});
    const bool is_late = lacks(late, from_first ? kLateBeginToleranceNs : 0);
    if (is_late && from_open_) {
      findings_->add(
          "stream-begins-late", place,
          name + " has nothing from " + text_of(*late) + ", before its first segment, and no gap says why");
    } else if (is_late) {
      is_not_shown(*late);
    }
  }
  if (!lines.closed_ns) {
    return;
  }
  const bool has_gap = !from_open_ && !gaps_.empty();
  const std::int64_t last_ns = end_ns_.value_or(has_gap ? gaps_.front().start_ns : lines.recorded_from_ns);
  const auto early = uncovered({last_ns, *lines.closed_ns});
  if (lacks(early, kEarlyEndToleranceNs)) {
    findings_->add("stream-ends-early", place,
                   name + " has nothing from " + text_of(*early) +
                       ", where the case was closed, and no gap among the lines says why");
  }
}

std::int64_t StreamRules::gap_within(std::int64_t from_ns, std::int64_t to_ns) const {
  std::int64_t total = 0;
  for (const Span& gap : gaps_) {
    total += std::max<std::int64_t>(0, std::min(gap.end_ns, to_ns) - std::max(gap.start_ns, from_ns));
  }
  return total;
}

}  // namespace kiroku::archive

#include "archive/verify/case_rules.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/format/excerpt_document.h"
#include "archive/format/pointing_stream.h"
#include "archive/format/segment_media.h"
#include "base/error.h"
#include "base/printable.h"

namespace kiroku::archive {

namespace {

// Times of frames and of entries are read one after the other.
constexpr std::int64_t kFutureToleranceNs = 2'000'000'000;
constexpr std::int64_t kPreRollToleranceNs = 2'000'000'000;

template <typename... Functions>
struct Overloaded : Functions... {
  using Functions::operator()...;
};
template <typename... Functions>
Overloaded(Functions...) -> Overloaded<Functions...>;

constexpr std::int64_t kNsPerUs = 1'000;
constexpr std::int64_t kUsPerSecond = 1'000'000;
constexpr std::int64_t kWallClockDiffersUs = 60 * kUsPerSecond;
// A recorder asks for its first token when it opens a case, and again each minute: two of these intervals. A
// token that rooms share, or an authority that is slow, is there by then. What the ledger itself states of
// its tokens does not count: whoever makes film up states that, too.
constexpr std::int64_t kFirstStampLateNs = 120'000'000'000;
// As much as of the first token: nobody gains more by the one than by the other.
constexpr std::int64_t kEnteredLateNs = kFirstStampLateNs;

/// As anybody can see it: "age1…", of whichever kind.
bool is_age_recipient(const std::string& text) {
  constexpr std::string_view kBegin = "age1";
  return text.starts_with(kBegin) && text.size() > kBegin.size() &&
         std::ranges::all_of(text, [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'); });
}

std::string at_entry(std::uint64_t number) { return "entry " + std::to_string(number); }

Place in_ledger(std::uint64_t number, std::optional<std::uint64_t> offset = std::nullopt) {
  return {std::string(kLedgerFile), number, offset};
}

}  // namespace

CaseRules::CaseRules(const CaseFolder& folder, const VerifyOptions& options, FindingList& findings,
                     CheckpointRules& checkpoints, FileChecker& files, Scope scope)
    : folder_(&folder),
      options_(&options),
      findings_(&findings),
      checkpoints_(&checkpoints),
      files_(&files),
      scope_(std::move(scope)),
      tokens_(folder, options, findings, checkpoints) {}

void CaseRules::say_no_readable_open(const LedgerLine& line) {
  findings_->add("open-missing", in_ledger(0, line.offset), "the ledger does not begin with a readable open");
}

void CaseRules::take(const LedgerLine& line, std::uint64_t number) {
  if (line.too_long) {
    count_broken_line(number);
    findings_->add("entry-too-long", in_ledger(number, line.offset),
                   "the line of " + at_entry(number) + " has " + std::to_string(line.bytes) +
                       " bytes where at most " + std::to_string(kMaximumLineBytes) + " are allowed");
    if (number == 0) say_no_readable_open(line);
    return;
  }
  const EntryParse parse = parse_case_entry(line.text);
  if (!parse.entry) {
    count_broken_line(number);
    findings_->add("entry-malformed", in_ledger(number, line.offset + parse.position.value_or(0)),
                   at_entry(number) + " is no entry of the format: " + parse.problem);
    if (number == 0) say_no_readable_open(line);
    return;
  }
  const CaseEntry& entry = *parse.entry;
  check_common(entry, number, line);
  std::visit(Overloaded{[&](const OpenEntry& open) { take_open(open, entry, number); },
                        [&](const SegmentEntry& segment) { take_segment(segment, number); },
                        [&](const GapEntry& gap) {
                          if (StreamRules* its = stream(gap.stream, number)) {
                            its->take(gap, number);
                          }
                        },
                        [&](const ErasedEntry& erased) {
                          if (!close_) {
                            findings_->add("erased-before-close", in_ledger(number),
                                           at_entry(number) + " says that segments of " + erased.stream +
                                               " were erased, although the case was not closed yet");
                            return;
                          }
                          StreamRules* its = stream(erased.stream, number);
                          if (checkpoints_->newest() <= number && scope_.whole_case) {
                            unsigned_aftermath_.insert(number);  // excuses no file that is not there
                          } else if (its != nullptr) {
                            its->take(erased, number);
                          }
                        },
                        [&](const ClockEntry& clock) { take_clock(clock, entry.at.mono_ns, number); },
                        [&](const TokenEntry& token) {
                          if (token.file.size() <= kMaximumPathBytes) {
                            named_.insert(token.file);
                          }
                          if (token.authority.size() <= kMaximumPathBytes) {
                            authorities_.insert(token.authority);
                          }
                          if (oldest_ns_) {
                            oldest_before_token_.emplace(number, *oldest_ns_);
                          }
                          last_token_ = number;
                          tokens_.take(token, number, entry.at.mono_ns);
                        },
                        [&](const TokenMissedEntry& missed) {
                          if (missed.authority.size() <= kMaximumPathBytes) {
                            authorities_.insert(missed.authority);
                          }
                          if (close_ && checkpoints_->newest() <= number) {
                            unsigned_aftermath_.insert(number);
                          }
                          tokens_.take_missed(missed, number);
                        },
                        [&](const RecoveredEntry& recovered) {
                          recovered_ = true;
                          if (marks_ != nullptr) marks_->take_recovered(before_ns_);
                          tokens_.take_recovered();
                          for (auto& [name, its] : streams_) {
                            its.take_recovered();
                          }
                          findings_->add("recovered", in_ledger(number),
                                         "recording was cut off (" + recovered.after + ") and found again" +
                                             (recovered.truncated.empty()
                                                  ? ""
                                                  : ": " + in_quotation_marks(recovered.truncated)) +
                                             take_signed_late(number));
                        },
                        [&](const CloseEntry& close) { take_close(close, entry, number); },
                        [&](const MarkEntry& mark) {
                          if (marks_ != nullptr) marks_->take_mark(mark, entry, number);
                        }},
             entry.body);
}

// Notes cannot be made up without the device's key: those that are there bound what was signed by then. An
// excerpt shows less: whoever makes one may leave a note out.
std::string CaseRules::take_signed_late(std::uint64_t recovered) {
  const std::uint64_t first = std::max(checkpoints_->covered(), scope_.first_line);
  if (first >= recovered) return {};
  // A second `recovered` signs what the first one had not come to sign.
  if (!signed_late_.empty() && signed_late_.back().first == first) signed_late_.pop_back();
  signed_late_.push_back({first, recovered - 1});
  const std::string entries =
      "the entries from " + std::to_string(first) + " to " + std::to_string(recovered - 1);
  return "; " +
         (scope_.whole_case ? entries + " had no signature until then"
                            : "this excerpt shows no signature over " + entries + " from before that") +
         ", so whoever could write to the disk meanwhile could have made them";
}

void CaseRules::count_broken_line(std::uint64_t number) {
  ++broken_lines_;
  if (gave_up()) {
    findings_->add("ledger-unreadable", in_ledger(number), unreadable_text(number));
  }
}

void CaseRules::check_common(const CaseEntry& entry, std::uint64_t number, const LedgerLine& line) {
  const bool is_open = std::holds_alternative<OpenEntry>(entry.body);
  if (entry.seq != number) {
    findings_->add("entry-out-of-sequence", in_ledger(number, line.offset),
                   "line " + std::to_string(number) + " has seq " + std::to_string(entry.seq));
  }
  if (number == 0 && !is_open) {
    findings_->add("open-missing", in_ledger(0, line.offset),
                   "the ledger begins with " + std::string(type_of(entry.body)) + " instead of open");
  }
  if (number != 0 && is_open) {
    findings_->add("open-repeated", in_ledger(number, line.offset), at_entry(number) + " is a second open");
  }
  if (entry.at.mono_ns < last_mono_ns_) {
    findings_->add("clock-went-back", in_ledger(number, line.offset),
                   "the case clock of " + at_entry(number) + " is " +
                       std::to_string(last_mono_ns_ - entry.at.mono_ns) +
                       " ns before that of the entry before it");
  }
  before_ns_ = std::exchange(last_mono_ns_, std::max(last_mono_ns_, entry.at.mono_ns));
  if (last_utc_ && entry.at.utc < *last_utc_ && !clock_step_stated_ &&
      !std::holds_alternative<ClockEntry>(entry.body)) {
    findings_->add("utc-went-back", in_ledger(number, line.offset),
                   "the machine's UTC of " + at_entry(number) + " is " + format_utc(entry.at.utc) +
                       ", before " + format_utc(*last_utc_) + " of the entry before it");
  }
  last_utc_ = entry.at.utc;
  clock_step_stated_ = false;
  const auto* const segment = std::get_if<SegmentEntry>(&entry.body);
  const bool is_of_a_recording = (segment != nullptr && segment->counted) ||
                                 std::holds_alternative<MarkEntry>(entry.body) ||
                                 std::holds_alternative<ClockEntry>(entry.body);
  if (recovered_ && is_of_a_recording) {
    findings_->add("entry-after-recovered", in_ledger(number, line.offset),
                   at_entry(number) + " is a " + std::string(type_of(entry.body)) +
                       " of a recording that goes on, behind recovered");
  }
  const bool may_follow_close = std::holds_alternative<TokenEntry>(entry.body) ||
                                std::holds_alternative<TokenMissedEntry>(entry.body) ||
                                std::holds_alternative<ErasedEntry>(entry.body);
  if (!may_follow_close) {
    last_claim_ = number;
  }
  if (!may_follow_close || std::holds_alternative<ErasedEntry>(entry.body)) {
    claims_ = number + 1;
  }
  if (close_ && !may_follow_close) {
    findings_->add("entry-after-close", in_ledger(number, line.offset),
                   at_entry(number) + " is a " + std::string(type_of(entry.body)) + " after close in " +
                       at_entry(*close_));
  }
}

void CaseRules::take_open(const OpenEntry& open, const CaseEntry& entry, std::uint64_t number) {
  if (number != 0) {
    return;
  }
  opening_ = open;
  opened_ = entry.at.utc;
  opened_ns_ = entry.at.mono_ns;
  clock_zero_ = entry.at.utc -
                std::chrono::floor<std::chrono::microseconds>(std::chrono::nanoseconds(entry.at.mono_ns));
  for (const StreamInfo& each : open.streams) {
    judge_form(each, number);
    StreamRules& its =
        streams_.emplace(each.name, StreamRules(each, scope_.whole_case, *findings_)).first->second;
    if (scope_.from_open) its.begin_at_open();
    if (marks_ != nullptr && holds_marks(each)) marks_->take_stream();
  }
  try {
    device_ = crypto::VerifierKey::parse(open.device);
    const crypto::VerifierKey signer = known_device(*device_, options_->devices);
    // The log's entry that states a key comes behind as many as the device had signed without it.
    const auto alone_until = [&](std::uint64_t since) -> std::uint64_t {
      return since > 0 && open.appliance_log_size <= since ? UINT64_MAX : 0;
    };
    checkpoints_->set_signer(signer, case_origin(device_->name(), open.case_id),
                             {alone_until(signer.ml_dsa_since()), alone_until(signer.hardware_since())});
    judge_device(*device_, *options_, *findings_);
  } catch (const UsageError& error) {
    findings_->add("device-invalid", in_ledger(0), std::string("open names no device: ") + error.what());
  }
  if (open.subject) {
    named_.insert(open.subject->file);
    if (scope_.whole_case) {
      files_->check({*open.subject, number, {}, {}, false});
    }
  }
}

void CaseRules::judge_form(const StreamInfo& stream, std::uint64_t number) {
  if (!is_of_the_format(stream)) {
    findings_->add("stream-form-unknown", in_ledger(number),
                   "open says of " + stream.name + " that it is of kind " + stream.kind + ", holds " +
                       stream.media + " and has the profile " +
                       in_quotation_marks(shortened(stream.profile)) +
                       ", which the format does not have together");
  }
  if (std::ranges::none_of(stream.recipients, is_age_recipient)) {
    findings_->add("stream-for-nobody", in_ledger(number),
                   "open names nobody for whom " + stream.name +
                       " is sealed: no age recipient is among its " +
                       std::to_string(stream.recipients.size()) + " recipients");
  }
}

void CaseRules::take_segment(const SegmentEntry& segment, std::uint64_t number) {
  StreamRules* its = stream(segment.stream, number);
  if (its == nullptr || !its->take(segment, number)) {
    return;
  }
  named_.insert(segment.file.file);
  if (marks_ != nullptr && holds_marks(*its->info())) marks_->take_segment(segment, number);
  // What recovery finds it takes to end by its own time, too.
  if (its->info()->timing == "arrival" && segment.span.end_ns - last_mono_ns_ > kFutureToleranceNs) {
    findings_->add("segment-in-future", {std::string(kLedgerFile), number},
                   at_entry(number) + " was written before segment " + std::to_string(segment.index) +
                       " of " + segment.stream +
                       " could end, though it is stated to be recorded as it comes");
  }
  if (!scope_.wanted || scope_.wanted(segment)) {
    first_checked_segment_ = first_checked_segment_.value_or(number);
    last_checked_segment_ = number;
    found_segments_ += segment.counted ? 0 : 1;
    oldest_ns_ = std::min(oldest_ns_.value_or(segment.span.start_ns), segment.span.start_ns);
    // Whether a film was read from a file, or was found, rests on the recorder's word, too.
    if (!its->is_of_marks()) {
      take_timed(segment, number);
    }
    files_->check(
        {segment.file, number, segment, its->info(), scope_.rekeyed && scope_.rekeyed(segment.file.file)});
  }
}

// What was recorded ahead is entered when the case is opened, however long before that it ended.
void CaseRules::take_timed(const SegmentEntry& segment, std::uint64_t number) {
  oldest_timed_ns_ = std::min(oldest_timed_ns_.value_or(segment.span.start_ns), segment.span.start_ns);
  if (last_token_ == 0) {
    return;
  }
  const Ended its{std::max(segment.span.end_ns, recorded_from_ns()), number};
  Ended& first = ended_first_behind_token_.try_emplace(last_token_, its).first->second;
  if (its.end_ns < first.end_ns) {
    first = its;
  }
  // A film from a file may lie ahead of the case clock.
  if (!segment.counted && streams_.at(segment.stream).info()->timing == "arrival") {
    Ended& last = found_last_behind_token_.try_emplace(last_token_, its).first->second;
    if (its.end_ns > last.end_ns) {
      last = its;
    }
  }
}

void CaseRules::take_clock(const ClockEntry& clock, std::int64_t mono_ns, std::uint64_t number) {
  if (clock.rate_ppb) {
    tokens_.take_rate(*clock.rate_ppb, mono_ns);
    if (std::abs(*clock.rate_ppb) <= kSlewPpb) {
      report_slew();
    } else if (!slew_ || std::abs(*clock.rate_ppb) > std::abs(slew_->rate_ppb)) {
      slew_ = Slew{slew_ ? slew_->entry : number, *clock.rate_ppb};
    }
  }
  if (clock.step_ns != 0) {
    clock_step_stated_ = true;
    if (marks_ != nullptr) marks_->take_step(mono_ns);
    stepped_ns_ += static_cast<double>(clock.step_ns);
    tokens_.take_step(clock.step_ns, mono_ns);
    findings_->add("clock-stepped", in_ledger(number),
                   "the machine's wall clock was set by " + std::to_string(clock.step_ns) + " ns");
  }
  if (!clock.synchronised && !said_not_synchronised_) {
    said_not_synchronised_ = true;
    findings_->add("clock-not-synchronised", in_ledger(number),
                   "the machine's wall clock was not synchronised");
  }
}

// Where a slew begins, its rate is that of a second in part of which it was there: a later entry knows
// better.
void CaseRules::report_slew() {
  if (slew_) {
    findings_->add("clock-slewed", in_ledger(slew_->entry),
                   "the machine's clocks, the case clock among them, were made to run " +
                       std::to_string(std::abs(slew_->rate_ppb) / 1'000) + " ppm " +
                       (slew_->rate_ppb > 0 ? "faster" : "slower") + " than its crystal");
  }
  slew_.reset();
}

void CaseRules::take_close(const CloseEntry& close, const CaseEntry& entry, std::uint64_t number) {
  if (close_) {
    return;  // a finding already
  }
  close_ = number;
  close_reason_ = shortened(close.reason);
  close_totals_ = close.totals;
  closed_ = entry.at.utc;
  closed_ns_ = entry.at.mono_ns;
  judge_end(entry.at.utc, entry.at.mono_ns, number);
  tokens_.take_close(number, entry.at.mono_ns);
  for (auto& [name, its] : streams_) {
    its.take_interruption();
    const auto stated = close.totals.find(name);
    its.check_totals(stated == close.totals.end() ? nullptr : &stated->second, number);
  }
  for (const auto& [name, total] : close.totals) {
    stream(name, number);
  }
}

// A recorder puts the beginning where its oldest segment begins. People read from it for how long something
// was recorded before anybody decided.
void CaseRules::judge_pre_roll(std::int64_t from_ns) {
  if (!is_pre_rolled() || from_ns >= opened_ns_) {
    return;
  }
  std::optional<std::int64_t> oldest_ns;
  for (const auto& [name, its] : streams_) {
    if (const auto first_ns = its.first_ns(); first_ns && (!oldest_ns || *first_ns < *oldest_ns)) {
      oldest_ns = first_ns;
    }
  }
  if (!oldest_ns || *oldest_ns - opening_->begins_ns <= kPreRollToleranceNs || *oldest_ns <= from_ns) {
    return;
  }
  if (!scope_.from_open) {
    findings_->add("excerpt-range-short", {std::string(kExcerptLinesFile)},
                   "the lines show nothing of the time before open, from " + std::to_string(from_ns) +
                       " ns on, of which the excerpt says that it is");
    return;
  }
  constexpr std::int64_t kNsPerSecond = 1'000'000'000;
  findings_->add("stream-begins-late", in_ledger(0),
                 "open says that the case begins " +
                     std::to_string((opened_ns_ - opening_->begins_ns) / kNsPerSecond) +
                     " s before it was opened, but nothing is there of the first " +
                     std::to_string((*oldest_ns - opening_->begins_ns) / kNsPerSecond) +
                     " s of that, and no gap says why");
}

// Both clocks are the machine's, and a slew moves both alike. People read how long a case lasted from its two
// times by the recorder's clock.
void CaseRules::judge_end(UtcTime closed, std::int64_t mono_ns, std::uint64_t number) {
  if (!opened_ || recovered_ || !scope_.whole_case) {
    return;
  }
  const auto elapsed_us = static_cast<double>((closed - *opened_).count());
  const double apart_us =
      elapsed_us - (static_cast<double>(mono_ns - opened_ns_) + stepped_ns_) / static_cast<double>(kNsPerUs);
  if (std::abs(apart_us) <= static_cast<double>(kWallClockDiffersUs)) {
    return;
  }
  findings_->add(
      "close-utc-differs", in_ledger(number),
      "by the machine's UTC the case ended " +
          std::to_string(std::llround(std::abs(apart_us) / static_cast<double>(kUsPerSecond))) + " s " +
          (apart_us > 0 ? "later" : "earlier") +
          " than by the case clock, and no clock entry says why: its length is that of the case clock");
}

StreamRules* CaseRules::stream(const std::string& name, std::uint64_t number) {
  const auto found = streams_.find(name);
  if (found != streams_.end()) {
    return &found->second;
  }
  if (opening_) {
    findings_->add(
        "stream-unknown", in_ledger(number),
        at_entry(number) + " is of a stream " + in_quotation_marks(name) + ", which open does not name");
  }
  return nullptr;
}

bool CaseRules::only_aftermath(std::uint64_t first, std::uint64_t end) const {
  for (std::uint64_t entry = first; entry < end; ++entry) {
    if (!unsigned_aftermath_.contains(entry) && !tokens_.restate_tokens(entry, entry + 1)) {
      return false;
    }
  }
  return true;
}

void CaseRules::finish(std::optional<std::int64_t> lines_begin_ns) {
  const std::optional<Span> recorded =
      close_ ? std::optional(Span{recorded_from_ns(), closed_ns_}) : std::nullopt;
  for (auto& [name, its] : streams_) {
    its.finish(recorded, lines_begin_ns);
  }
  if (recorded && scope_.whole_case && opening_) {
    judge_pre_roll(opening_->begins_ns);
    judge_streams();
  }
  report_slew();
  tokens_.finish(scope_.whole_case, scope_.from_open);
  judge_wall_clock();
  judge_first_stamp();
  judge_late_entries();
  judge_found();
}

// No recorder begins a case without one, and no rule of a stream asks for what is not named.
void CaseRules::judge_streams() {
  const auto is_recorded = [](const auto& each) { return !each.second.is_of_marks(); };
  if (std::ranges::none_of(streams_, is_recorded)) {
    findings_->add("no-stream", in_ledger(0),
                   "open names no stream of pictures or vital signs: the case shows nothing of an operation, "
                   "and says nothing of why");
  }
}

void CaseRules::judge_wall_clock() {
  for (const auto& [authority, first] : tokens_.first_outside()) {
    if (!clock_zero_) {
      continue;
    }
    // In microseconds: an `open` that somebody made up may lie thousands of years away.
    const std::int64_t ahead_us = (first.gen_time - *clock_zero_).count() - first.case_ns / kNsPerUs;
    if (std::abs(ahead_us) - first.half_width_ns / kNsPerUs > kWallClockDiffersUs) {
      findings_->add(
          "clock-differs", in_ledger(0),
          "by " + authority + " the recorder's wall clock was " +
              std::to_string(std::abs(ahead_us) / kUsPerSecond) + " s " +
              (ahead_us > 0 ? "behind" : "ahead") +
              ": the case's identifier and every time \"by the recorder's clock\" are wrong by that "
              "much; the time-stamps are not");
    }
  }
}

void CaseRules::judge_first_stamp() {
  const std::optional<StampedToken> entered = tokens_.first_entered();
  if (!scope_.whole_case) {
    if (entered) {
      judge_first_stamp_of_excerpt(*entered);
    }
    return;
  }
  const std::optional<StampedToken> first = tokens_.first_after_close();
  if (first && closed_) {
    const std::int64_t late_us = (first->gen_time - *closed_).count();
    findings_->add(
        "stamped-after-close", {first->file, first->entry},
        "the first time-stamp of an outside authority is over close, and by the recorder's clock " +
            std::to_string(std::abs(late_us) / kUsPerSecond) + " s " + (late_us < 0 ? "before" : "after") +
            " it: the case was there by then; when it was recorded, and for how long, rests on "
            "the recorder's word");
  } else if (entered) {
    judge_age_at_first_stamp(*entered);
  }
}

// An excerpt shows no more of its case than its lines: what its makers left out cannot bound what they chose.
void CaseRules::judge_first_stamp_of_excerpt(const StampedToken& first) {
  if (!last_checked_segment_ || first.entry < *last_checked_segment_) {
    judge_age_at_first_stamp(first);
    return;
  }
  findings_->add("stamped-after-close", {first.file, first.entry},
                 "the first time-stamp of an outside authority is entered behind the excerpt's last segment, "
                 "which is in " +
                     at_entry(*last_checked_segment_) +
                     ": before that nobody outside had seen any of it; when it was recorded, and for how "
                     "long, rests on the recorder's word");
}

void CaseRules::judge_age_at_first_stamp(const StampedToken& first) {
  const auto before = oldest_before_token_.find(first.entry);
  std::optional<std::int64_t> oldest_ns = oldest_timed_ns_;
  if (before != oldest_before_token_.end()) {
    oldest_ns = std::min(oldest_ns.value_or(before->second), before->second);
  }
  if (!oldest_ns || first.entered_ns - *oldest_ns <= kFirstStampLateNs) {
    return;
  }
  age_at_first_stamp_ns_ = first.entered_ns - *oldest_ns;
  findings_->add("first-stamped-late", {first.file, first.entry},
                 "by the case clock recording began " +
                     std::to_string(*age_at_first_stamp_ns_ / kNsPerUs / kUsPerSecond) +
                     " s before the first time-stamp of an outside authority was entered: that what was "
                     "recorded until then is no older than that rests on the recorder's word");
}

// Such a token proves no more than that the entry is younger than itself. It is read as a limit of the film.
void CaseRules::judge_late_entries() {
  const std::vector<StampedToken>& outside = tokens_.outside();  // in the ledger's order
  auto next = outside.begin();
  const StampedToken* before = nullptr;
  const StampedToken* its_token = nullptr;
  Ended worst;
  for (const auto& [token, first] : ended_first_behind_token_) {
    for (; next != outside.end() && next->entry <= token; ++next) {
      before = &*next;
    }
    if (before != nullptr && before->entered_ns - first.end_ns > entered_late_ns_.value_or(kEnteredLateNs)) {
      entered_late_ns_ = before->entered_ns - first.end_ns;
      its_token = before;
      worst = first;
    }
  }
  if (its_token != nullptr) {
    findings_->add("segments-entered-late", {std::string(kLedgerFile), worst.entry},
                   "by the case clock the segment of " + at_entry(worst.entry) + " ended " +
                       std::to_string(*entered_late_ns_ / kNsPerUs / kUsPerSecond) + " s before " +
                       its_token->file +
                       " was entered, behind which it stands: that it is no older than it says rests on the "
                       "recorder's word");
  }
}

// Behind `recovered` no clock is compared with those of the tokens before it, so whoever makes film up may
// let the case clock go on as they like there. What was found is older than a token over it all the same.
void CaseRules::judge_found() {
  const std::vector<StampedToken>& outside = tokens_.outside();  // in the ledger's order
  for (const auto& [token, last] : found_last_behind_token_) {
    const auto behind = std::ranges::upper_bound(outside, token, {}, &StampedToken::entry);
    // One that came before the crash may be entered after it: it is over what is before.
    const auto after = std::find_if(behind, outside.end(), [entry = last.entry](const StampedToken& each) {
      return each.checkpoint > entry;
    });
    if (behind == outside.begin() || after == outside.end()) {
      continue;
    }
    const StampedToken& before = *std::prev(behind);
    const std::int64_t passed_us = std::max<std::int64_t>(0, (after->gen_time - before.gen_time).count());
    // Slews move the case clock by no more than an eighth.
    const std::int64_t most_us = passed_us + passed_us / 8 + kEnteredLateNs / kNsPerUs;
    if ((last.end_ns - before.entered_ns) / kNsPerUs > most_us) {
      findings_->add("segment-in-future", {std::string(kLedgerFile), last.entry},
                     "the segment of " + at_entry(last.entry) + ", which recovery found, is stated to end " +
                         std::to_string((last.end_ns - before.entered_ns) / kNsPerUs / kUsPerSecond) +
                         " s after " + before.file + " was entered, and only " +
                         std::to_string(passed_us / kUsPerSecond) + " s passed from there to " + after->file +
                         ", which is over it");
      return;
    }
  }
}

void CaseRules::judge_missing(const std::vector<MissingFile>& missing) {
  for (const MissingFile& each : missing) {
    const auto its = each.stream ? streams_.find(each.stream->name) : streams_.end();
    if (its != streams_.end() && its->second.erased(each.index)) {
      its->second.count_erased();
      continue;
    }
    findings_->add("file-missing", {each.file, each.entry},
                   each.file + " is not there, which " + at_entry(each.entry) + " names");
  }
}

bool CaseRules::erased(const std::string& path) const {
  const std::filesystem::path parts(path);
  const auto its = streams_.find(parts.parent_path().filename().string());
  if (its == streams_.end() || !names(path)) {
    return false;
  }
  const std::string name = parts.filename().string();
  const std::optional<std::uint64_t> index = parse_index(name.substr(0, name.find('.')));
  return index && its->second.erased(*index);
}

const StreamRules* CaseRules::stream_of_folder(const std::string& path) const {
  const std::string prefix = std::string(kSegmentsFolder) + "/";
  const std::size_t end = path.find('/', prefix.size());
  if (!path.starts_with(prefix) || end == std::string::npos) {
    return nullptr;
  }
  const auto its = streams_.find(path.substr(prefix.size(), end - prefix.size()));
  return its == streams_.end() ? nullptr : &its->second;
}

bool CaseRules::is_folder(const std::string& path) const {
  for (const std::string_view folder :
       {kCheckpointsFolder, kTokensFolder, kSegmentsFolder, kAuthoritiesFolder}) {
    if (path == folder) {
      return true;
    }
  }
  const std::string prefix = std::string(kSegmentsFolder) + "/";
  return path.starts_with(prefix) && streams_.contains(path.substr(prefix.size()));
}

void CaseRules::check_device_file() {
  if (!opening_) {
    return;
  }
  const Place place{std::string(kDeviceFile)};
  const FileOpening opening = folder_->open_file(kDeviceFile);
  if (!opening.file && opening.problem != FileProblem::kMissing) {
    report_unopened(*findings_, place, opening);
    return;
  }
  std::optional<std::string> text;
  try {
    text = opening.file ? read_small(*opening.file, kMaximumNoteBytes) : std::nullopt;
  } catch (const IoError& error) {
    findings_->add("file-unreadable", place, std::string(error.what()) + "; so it was not checked");
    return;
  }
  if (text != opening_->device + "\n") {
    findings_->add("device-file-differs", place,
                   std::string(kDeviceFile) +
                       (opening.file ? " is not the key that open names" : " is not there") +
                       "; it is a convenience that nothing was checked with");
  }
}

void CaseRules::describe(VerificationReport& report) const {
  if (opening_) {
    report.case_id = opening_->case_id;
    report.device = opening_->device;
    for (const StreamInfo& each : opening_->streams) {
      report.streams.push_back(streams_.at(each.name).report());
    }
  }
  report.opened = opened_;
  report.clock_zero = clock_zero_;
  report.closed = closed_;
  report.time = scope_.whole_case
                    ? tokens_.time(0, last_claim_)
                    : tokens_.time(first_checked_segment_.value_or(0), last_checked_segment_.value_or(0));
  report.outside_entries = tokens_.outside_entries();
  report.age_at_first_stamp_ns = age_at_first_stamp_ns_;
  report.entered_late_ns = entered_late_ns_;
  report.tokens = tokens_.count();
  report.outside_tokens = tokens_.outside_count();
  report.own_tokens = tokens_.own_count();
  report.authorities = tokens_.authorities();
  report.proving_tokens = tokens_.proving();
  report.signed_late = signed_late_;
  report.found_segments = found_segments_;
}

}  // namespace kiroku::archive

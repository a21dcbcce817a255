#include "archive/verify/case_clock_rules.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <iterator>
#include <utility>

#include "archive/format/case_layout.h"

namespace kiroku::archive {
namespace {

using std::chrono::nanoseconds;

// Tokens often state whole seconds (RFC 3161 2.4.2: the fraction may be left out) and a crystal drifts.
constexpr std::int64_t kSlackNs = 2'000'000'000;
constexpr std::int64_t kStepStatedWithinNs = 2'000'000'000;
// A crystal is right to 100 ppm; a processor's counter that was calibrated badly, and that nothing corrects,
// to some hundreds.
constexpr std::int64_t kDriftDivisor = 2'000;  // 0.05 %
constexpr std::int64_t kNsPerUs = 1'000;
// Less is lost in what each comparison tolerates.
constexpr std::int64_t kSlewsSaidFromNs = 1'000'000'000;

std::string at_entry(std::uint64_t entry) { return "entry " + std::to_string(entry); }

std::int64_t ns_of(UtcTime::duration duration) {
  return std::chrono::duration_cast<nanoseconds>(duration).count();
}

std::string seconds(std::int64_t us) {
  const std::int64_t ms = us / 1'000;
  std::string fraction = std::to_string(std::abs(ms % 1'000));
  fraction.insert(0, 3 - fraction.size(), '0');
  return (ms < 0 && ms > -1'000 ? "-" : "") + std::to_string(ms / 1'000) + "." + fraction + " s";
}

}  // namespace

void CaseClockRules::take(TimedToken token) {
  Timed timed{std::move(token), recoveries_};
  see(timed.written_ns);
  tokens_.push_back(std::move(timed));
}

void CaseClockRules::take_rate(std::int64_t rate_ppb, std::int64_t mono_ns) {
  slews_.add(rate_ppb, mono_ns);
  first_rate_ns_ = first_rate_ns_.value_or(mono_ns);
  see(mono_ns);
}

void CaseClockRules::take_recovered() {
  ++recoveries_;
  if (seen_) {
    slews_.cut_off(seen_->end_ns);
  }
}

void CaseClockRules::see(std::int64_t mono_ns) {
  if (!seen_) {
    seen_ = Span{mono_ns, mono_ns};
  }
  seen_->end_ns = std::max(seen_->end_ns, mono_ns);
}

std::set<std::string> CaseClockRules::finish(bool from_open) {
  std::sort(steps_.begin(), steps_.end(), [](const Step& a, const Step& b) { return a.mono_ns < b.mono_ns; });
  stepped_before_ = {0};
  for (const Step& step : steps_) {
    stepped_before_.push_back(stepped_before_.back() + std::abs(static_cast<double>(step.step_ns)));
  }
  std::uint64_t recoveries = 0;
  for (Timed& now : tokens_) {
    if (std::exchange(recoveries, now.recoveries) != now.recoveries) {
      pace_of_.clear();
    }
    now.slewed_from_ns = slews_.until(now.earliest_ns.value_or(0));
    now.slewed_ns = slews_.until(now.latest_ns);
    const bool agrees = check_elapsed(now);
    if (now.external) {
      check_order(now, agrees);
    }
  }
  std::set<std::string> was_set = report_contradictions(from_open);
  report_disagreements();
  report_slews();
  report_late_end(was_set);
  return was_set;
}

// Whoever holds the device key writes when a token was asked for, when it was answered and when it was
// entered. Only `close` bounds what the case says that it is long.
void CaseClockRules::report_late_end(const std::set<std::string>& left_out) {
  if (!closed_ns_) {
    return;
  }
  Pace pace;
  std::uint64_t recoveries = 0;
  const Timed* soonest = nullptr;
  std::int64_t late_us = 0;
  for (const Timed& now : tokens_) {
    if (!now.external || now.stamped.checkpoint == 0 || !now.earliest_ns ||
        left_out.contains(now.stamped.root)) {
      continue;
    }
    if (std::exchange(recoveries, now.recoveries) != now.recoveries) {
      pace = {};
    }
    if (!now.is_over_end) {
      pace.add(now);
      continue;
    }
    Timed at_close = now;
    at_close.earliest_ns = at_close.latest_ns = *closed_ns_;
    at_close.slewed_from_ns = at_close.slewed_ns = slews_.until(*closed_ns_);
    const std::optional<std::int64_t> by_us = pace.late_us(at_close);
    if (by_us && (soonest == nullptr || *by_us < late_us)) {
      soonest = &now;
      late_us = *by_us;
    }
  }
  if (soonest != nullptr && late_us > 0) {
    findings_->add("end-stamped-late", {soonest->file, soonest->stamped.entry},
                   soonest->file + ", which is over the end, is " + seconds(late_us) +
                       " later than the case clock of close explains: that recording ended at close, and "
                       "did not go on, rests on the recorder's word");
  }
}

// Who states slews that were none makes up so much of the case clock, and the kernel's limit is all that
// bounds it: whoever reads the report should hear how much that is.
void CaseClockRules::report_slews() {
  if (!seen_) {
    return;
  }
  const std::int64_t moved_ns = slews_.until(seen_->end_ns) - slews_.until(seen_->start_ns);
  if (moved_ns >= kSlewsSaidFromNs) {
    findings_->add("clock-slews-allowed-for", {},
                   "the slews that the ledger states may have moved the case clock by up to " +
                       seconds(moved_ns / kNsPerUs) +
                       " in all: by so much the authorities' times may differ from it without a finding");
  }
}

void CaseClockRules::Order::add(const StampedToken& token) {
  const bool later = latest_.empty() || tokens_[latest_.back()]->earliest() < token.earliest();
  latest_.push_back(later ? tokens_.size() : latest_.back());
  tokens_.push_back(&token);
}

const StampedToken* CaseClockRules::Order::latest_below(std::uint64_t size) const {
  const auto covered = std::partition_point(tokens_.begin(), tokens_.end(),
                                            [&](const StampedToken* a) { return a->entry < size; });
  return covered == tokens_.begin()
             ? nullptr
             : tokens_[latest_[static_cast<std::size_t>(covered - tokens_.begin()) - 1]];
}

namespace {

std::string breach_of(const StampedToken& now, const StampedToken& before) {
  return now.file + " says " + format_utc(now.gen_time) + ", yet it covers " + at_entry(before.entry) +
         " with the token of " + before.authority + " of " + format_utc(before.gen_time);
}

}  // namespace

// A token that covers another was made later, whatever the ledger says: where it says otherwise, a clock was
// wrong. That of the recorder's own authority is the recorder's, which check_elapsed() looks at.
void CaseClockRules::check_order(const Timed& now, bool agrees) {
  const StampedToken& token = now.stamped;
  Order& order = order_of_[token.root];
  const StampedToken* before = order.latest_below(token.checkpoint);
  // RFC 3161 2.4.2: an authority that states `ordering` can always be held to it.
  const std::int64_t slack_ns = now.ordering ? 0 : kSlackNs;
  if (agrees && before != nullptr && ns_of(before->earliest() - token.latest()) > slack_ns) {
    findings_->add("token-order", {now.file, token.entry},
                   breach_of(token, *before) + ": its clock was set back");
  }
  order.add(token);
}

void CaseClockRules::compare_authorities(const std::set<std::string>& left_out) {
  Order order;
  Pace pace;
  std::uint64_t recoveries = 0;
  for (const Timed& now : tokens_) {
    const StampedToken& token = now.stamped;
    if (!now.external || token.checkpoint == 0 || left_out.contains(token.root)) {
      continue;
    }
    const Place place{now.file, token.entry};
    const StampedToken* before = order.latest_below(token.checkpoint);
    const bool breach = before != nullptr && before->root != token.root &&
                        ns_of(before->earliest() - token.latest()) > kSlackNs;
    if (breach) {
      findings_->add("authorities-disagree", place,
                     breach_of(token, *before) + ": the clock of one of the two is wrong");
    }
    order.add(token);
    if (!now.earliest_ns) {
      continue;
    }
    if (std::exchange(recoveries, now.recoveries) != now.recoveries) {
      pace = {};
    }
    const std::optional<Difference> found = pace.difference(now);
    if (found && found->before->stamped.root != token.root && !breach) {
      findings_->add("authorities-disagree", place,
                     Pace::text(*found, now) + ": one of the three clocks is wrong");
    }
    if (!now.stands) {
      if (found) {
        pace = {};
      }
      pace.add(now);
    }
  }
}

// Each comparison allows for two seconds. Were a token compared with the one before alone, whoever asks for
// one a second could leave out as much as they like. Nor is it the ledger's name for an authority that
// decides which are compared.
bool CaseClockRules::check_elapsed(const Timed& now) {
  if (!now.earliest_ns) {
    return true;  // over a checkpoint that is not there, or before an excerpt
  }
  Pace& pace = pace_of_[now.stamped.root.empty() ? now.stamped.authority : now.stamped.root];
  const std::optional<Difference> found = pace.difference(now);
  if (!now.stands) {
    const bool goes_on = pace.last != nullptr && !found;
    if (!goes_on) {
      pace = {};
    }
    pace.add(now);
    if (now.external) {
      std::vector<AgreeingRun>& agreeing = agreeing_[now.stamped.root];
      if (!goes_on) {
        agreeing.emplace_back();
      }
      agreeing.back().add(now);
    }
  }
  if (!found) {
    return true;
  }
  const Place place{now.file, now.stamped.entry};
  const std::int64_t from_ns = found->before->written_ns;
  if (now.external) {
    contradicting_.insert(now.stamped.root);
    contradictions_.push_back({place,
                               Pace::text(*found, now),
                               now.stamped.root,
                               {from_ns, now.written_ns},
                               found->elapsed_us > found->longest_us,
                               found->excess_us});
  } else {
    disagreements_.push_back({place, Pace::text(*found, now), from_ns, now.written_ns, found->excess_us});
  }
  return false;
}

std::string CaseClockRules::Pace::text(const Difference& found, const Timed& now) {
  const Timed& before = *found.before;
  return "between " + before.file + " in " + at_entry(before.stamped.entry) + " and " + now.file + " in " +
         at_entry(now.stamped.entry) + " the authorities' time went on by " + seconds(found.elapsed_us) +
         " and the case clock by " + seconds(found.shortest_us) + " to " + seconds(found.longest_us);
}

void CaseClockRules::Pace::add(const Timed& token) {
  last = &token;
  const std::int64_t drift_us = (*token.earliest_ns / kDriftDivisor + token.slewed_from_ns) / kNsPerUs;
  const std::int64_t gen_us = token.stamped.gen_time.time_since_epoch().count();
  const std::int64_t accuracy_us = token.stamped.accuracy_ns / kNsPerUs;
  const std::int64_t ahead_us = gen_us - accuracy_us - token.latest_ns / kNsPerUs + drift_us;
  const std::int64_t behind_us = *token.earliest_ns / kNsPerUs - gen_us - accuracy_us + drift_us;
  if (!most_ahead || ahead_us > most_ahead->first) {
    most_ahead.emplace(ahead_us, &token);
  }
  if (!most_behind || behind_us > most_behind->first) {
    most_behind.emplace(behind_us, &token);
  }
}

CaseClockRules::Difference CaseClockRules::Pace::compare(const Timed& before, const Timed& now) {
  const std::int64_t longest_ns = now.latest_ns - *before.earliest_ns;
  Difference found;
  found.before = &before;
  found.shortest_us = (*now.earliest_ns - before.latest_ns) / kNsPerUs;
  found.longest_us = longest_ns / kNsPerUs;
  found.elapsed_us = (now.stamped.gen_time - before.stamped.gen_time).count();
  const std::int64_t accuracies_ns = before.stamped.accuracy_ns + now.stamped.accuracy_ns;
  const std::int64_t slewed_ns = now.slewed_ns - before.slewed_from_ns;
  const std::int64_t tolerance_us =
      (kSlackNs + accuracies_ns + longest_ns / kDriftDivisor + slewed_ns) / kNsPerUs;
  const std::int64_t too_slow_us = found.shortest_us - tolerance_us - found.elapsed_us;
  found.too_fast_us = found.elapsed_us - found.longest_us - tolerance_us;
  found.excess_us = std::max(too_slow_us, now.stands ? 0 : found.too_fast_us);
  return found;
}

std::array<const CaseClockRules::Timed*, 3> CaseClockRules::Pace::strictest() const {
  return {last, most_ahead ? most_ahead->second : nullptr, most_behind ? most_behind->second : nullptr};
}

std::optional<std::int64_t> CaseClockRules::Pace::late_us(const Timed& now) const {
  std::optional<std::int64_t> most;
  for (const Timed* before : strictest()) {
    if (before != nullptr) {
      most = std::max(most.value_or(INT64_MIN), compare(*before, now).too_fast_us);
    }
  }
  return most;
}

std::optional<CaseClockRules::Difference> CaseClockRules::Pace::difference(const Timed& now) const {
  for (const Timed* before : strictest()) {
    if (before == nullptr) {
      continue;
    }
    const Difference found = compare(*before, now);
    if (found.excess_us > 0) {
      return found;
    }
  }
  return std::nullopt;
}

void CaseClockRules::AgreeingRun::add(const Timed& token) {
  const std::int64_t gen_us = token.stamped.gen_time.time_since_epoch().count();
  const std::int64_t accuracy_us = token.stamped.accuracy_ns / kNsPerUs;
  const std::int64_t earliest_us = *token.earliest_ns / kNsPerUs, latest_us = token.latest_ns / kNsPerUs;
  const std::int64_t allowed_until_us =
      (*token.earliest_ns / kDriftDivisor + token.slewed_from_ns) / kNsPerUs;
  const std::int64_t allowed_us = (token.latest_ns / kDriftDivisor + token.slewed_ns) / kNsPerUs;
  Bounds until{token.written_ns, gen_us - accuracy_us - latest_us + allowed_until_us,
               earliest_us - gen_us - accuracy_us + allowed_until_us};
  if (until_.empty()) {
    span_.start_ns = token.written_ns;
  } else {
    const Bounds& before = until_.back();
    until = {std::max(before.written_ns, until.written_ns), std::max(before.ahead_us, until.ahead_us),
             std::max(before.behind_us, until.behind_us)};
  }
  span_.end_ns = token.written_ns;
  until_.push_back(until);
  from_.push_back({token.written_ns, gen_us + accuracy_us - earliest_us + allowed_us,
                   latest_us - gen_us + accuracy_us + allowed_us});
}

void CaseClockRules::AgreeingRun::finish() {
  for (std::size_t i = from_.size(); i-- > 1;) {
    Bounds& before = from_[i - 1];
    before = {std::min(before.written_ns, from_[i].written_ns), std::min(before.ahead_us, from_[i].ahead_us),
              std::min(before.behind_us, from_[i].behind_us)};
  }
}

std::optional<std::int64_t> CaseClockRules::AgreeingRun::at_most_us(const Span& over, bool ahead) const {
  const auto until = std::ranges::upper_bound(until_, over.start_ns, {}, &Bounds::written_ns);
  const auto from = std::ranges::lower_bound(from_, over.end_ns, {}, &Bounds::written_ns);
  if (until == until_.begin() || from == from_.end()) {
    return std::nullopt;
  }
  const Bounds& before = *std::prev(until);
  return ahead ? from->ahead_us - before.ahead_us : from->behind_us - before.behind_us;
}

// Whoever holds the device key writes when a token was asked for and answered, and an authority may state
// that it is right to a minute alone: then its time fits both clocks, and clears neither. Nor does one whose
// own clock differs from the case's elsewhere. An authority's clock agrees from one difference to the next,
// so its runs follow each other.
bool CaseClockRules::is_confirmed(const Contradiction& one) const {
  return std::ranges::any_of(agreeing_, [&](const auto& each) {
    const auto& [root, runs] = each;
    const auto after = std::ranges::upper_bound(runs, one.span.start_ns, {},
                                                [](const AgreeingRun& run) { return run.span().start_ns; });
    if (contradicting_.contains(root) || after == runs.begin()) {
      return false;
    }
    const std::optional<std::int64_t> at_most_us = std::prev(after)->at_most_us(one.span, one.ahead);
    return at_most_us && *at_most_us < one.excess_us;
  });
}

bool CaseClockRules::may_be_slewed_unseen(const Contradiction& one) const {
  const std::int64_t seen_from_ns = std::min(first_rate_ns_.value_or(one.span.end_ns), one.span.end_ns);
  const double unseen_us =
      static_cast<double>(std::max<std::int64_t>(0, seen_from_ns - one.span.start_ns)) / kNsPerUs;
  return static_cast<double>(one.excess_us) <= unseen_us * (StatedSlews::kFastestPpb / 1e9);
}

/// Contradictions that go one way, for the question whether another authority has one over the same time. As
/// many as the case has tokens, so nothing is compared with each.
class CaseClockRules::SharedTimes {
 public:
  SharedTimes(const std::vector<Contradiction>& all, bool ahead) {
    for (const Contradiction& each : all) {
      if (each.ahead == ahead) {
        by_start_.push_back(&each);
      }
    }
    std::ranges::sort(by_start_, {}, [](const Contradiction* each) { return each->span.start_ns; });
    Latest latest;
    for (const Contradiction* each : by_start_) {
      const std::int64_t end_ns = each->span.end_ns;
      if (latest.of == nullptr || each->root == latest.of->root) {
        latest.of = latest.of == nullptr || end_ns > latest.of->span.end_ns ? each : latest.of;
      } else if (end_ns > latest.of->span.end_ns) {
        latest = {each, latest.of};
      } else if (latest.of_another == nullptr || end_ns > latest.of_another->span.end_ns) {
        latest.of_another = each;
      }
      latest_.push_back(latest);
    }
  }

  [[nodiscard]] bool has_anothers(const Contradiction& one) const {
    const auto later = std::ranges::lower_bound(
        by_start_, one.span.end_ns, {}, [](const Contradiction* each) { return each->span.start_ns; });
    if (later == by_start_.begin()) {
      return false;
    }
    const Latest& latest = latest_[static_cast<std::size_t>(later - by_start_.begin()) - 1];
    const Contradiction* const other = latest.of->root != one.root ? latest.of : latest.of_another;
    return other != nullptr && one.span.start_ns < other->span.end_ns;
  }

 private:
  /// Which ends last, and which of those of all other authorities.
  struct Latest {
    const Contradiction* of = nullptr;
    const Contradiction* of_another = nullptr;
  };
  std::vector<const Contradiction*> by_start_;
  std::vector<Latest> latest_;  // up to each
};

// An authority may set its own clock right, and who holds the device key may state a case clock of their own.
// One authority cannot tell the two apart: what it says then proves no time, as if it had not been asked. Two
// that do not know of each other do not set theirs at the same time, by the same way.
std::set<std::string> CaseClockRules::report_contradictions(bool from_open) {
  std::set<std::string> was_set;
  for (auto& [root, runs] : agreeing_) {
    for (AgreeingRun& run : runs) {
      run.finish();
    }
    std::ranges::sort(
        runs, {}, [](const AgreeingRun& run) { return std::pair(run.span().start_ns, run.span().end_ns); });
  }
  const SharedTimes ahead(contradictions_, true), behind(contradictions_, false);
  for (const Contradiction& one : contradictions_) {
    const bool shared = (one.ahead ? ahead : behind).has_anothers(one);
    const bool stated =
        static_cast<double>(one.excess_us) * kNsPerUs <= stepped_ns(one.span.start_ns, one.span.end_ns);
    if (shared && stated) {
      findings_->add("authority-clock-differs", one.place,
                     one.text +
                         ", which is how far the wall clock was set: the case clock stood, as in a "
                         "virtual machine that was paused, or was made up");
    } else if (shared && !from_open && may_be_slewed_unseen(one)) {
      findings_->add(
          "authority-clock-differs", one.place,
          one.text +
              ", and so did another authority's: a slew may explain it, which a clock entry in front "
              "of these lines would state");
    } else if (shared) {
      findings_->add("clock-contradicted", one.place, one.text + ", and so did another authority's");
    } else if (is_confirmed(one)) {
      findings_->add("authority-clock-set", one.place,
                     one.text + ", and that of another authority as the case clock, and not as this one's");
      was_set.insert(one.root);
    } else {
      findings_->add("authority-clock-differs", one.place, one.text + ": one of the two was set");
    }
  }
  // Where an authority alone differs, that was said.
  const bool all_are_out = std::ranges::all_of(
      contradictions_, [&](const Contradiction& one) { return was_set.contains(one.root); });
  if (all_are_out) {
    compare_authorities(was_set);
  }
  return was_set;
}

double CaseClockRules::stepped_ns(std::int64_t from_ns, std::int64_t until_ns) const {
  const auto steps_before = [&](std::int64_t mono_ns) {
    const auto first = std::partition_point(steps_.begin(), steps_.end(),
                                            [&](const Step& step) { return step.mono_ns < mono_ns; });
    return stepped_before_[static_cast<std::size_t>(first - steps_.begin())];
  };
  return steps_before(until_ns + kStepStatedWithinNs + 1) - steps_before(from_ns - kStepStatedWithinNs);
}

void CaseClockRules::report_disagreements() {
  for (const Disagreement& each : disagreements_) {
    if (static_cast<double>(each.excess_us) * kNsPerUs > stepped_ns(each.from_ns, each.until_ns)) {
      findings_->add("clock-disagreement", each.place, each.text);
    }
  }
}

}  // namespace kiroku::archive

#include "archive/verify/token_rules.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/verify/file_checker.h"
#include "base/error.h"

namespace kiroku::archive {

namespace {

using std::chrono::nanoseconds;

// Tokens often state whole seconds (RFC 3161 2.4.2: the fraction may be left out) and a crystal drifts.
constexpr std::int64_t kSlackNs = 2'000'000'000;
constexpr std::int64_t kStepStatedWithinNs = 2'000'000'000;
constexpr std::int64_t kDriftDivisor = 5'000;  // 0.02 %
constexpr std::int64_t kNsPerUs = 1'000;
// Linux: a tick of 9,000 to 11,000 us and 500 ppm beside it (adjtimex(2)).
constexpr std::int64_t kFastestSlewPpb = 100'500'000;

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

TokenRules::TokenRules(const CaseFolder& folder, const VerifyOptions& options, FindingList& findings,
                       const CheckpointRules& checkpoints)
    : folder_(&folder), options_(&options), findings_(&findings), checkpoints_(&checkpoints) {}

void TokenRules::take(const TokenEntry& token, std::uint64_t entry, std::int64_t mono_ns) {
  ++count_;
  hashes_[entry] = token.sha256;
  const Place place{token.file, entry};
  if (token.file != token_path(token.checkpoint, token.authority)) {
    findings_->add("token-name-differs", place,
                   at_entry(entry) + " names " + token.file + " where " +
                       token_path(token.checkpoint, token.authority) + " must be");
    return;
  }
  if (!entered_.emplace(token.checkpoint, token.authority).second) {
    findings_->add("token-repeated", place, at_entry(entry) + " enters " + token.file + " a second time");
    return;
  }
  if (token.checkpoint > entry) {
    findings_->add("token-covers-later", place,
                   at_entry(entry) + " names a checkpoint of " + std::to_string(token.checkpoint) +
                       " entries, which did not exist yet");
    return;
  }
  largest_checkpoint_ = std::max(largest_checkpoint_, token.checkpoint);
  const std::optional<std::string> response = read_token(token, entry);
  const Judged judged = response ? judge(token, entry, *response) : Judged{};
  if (judged.restated && close_) {
    restating_.insert(entry);
  }

  Earlier now;
  now.entry = entry;
  now.checkpoint = token.checkpoint;
  now.mono_ns = now.latest_ns = mono_ns;
  now.gen_time = token.gen_time;
  now.accuracy_ns = token.accuracy_ns;
  now.external = judged.valid && judged.external;
  now.slewed_ns = slewed_until(mono_ns);
  now.stands = close_ && token.checkpoint > *close_;
  now.recoveries = recoveries_;
  now.root = judged.root;
  now.file = token.file;
  now.earliest_ns = checkpoints_->mono_at(token.checkpoint);
  check_exchange(token, entry, mono_ns);
  if (token.exchange) {
    now.earliest_ns = token.exchange->asked_ns;
    now.latest_ns = token.exchange->answered_ns;
  }
  const bool agrees = check_elapsed(token, now);
  const StampedToken stamped{entry,           token.checkpoint, token.gen_time, token.accuracy_ns,
                             token.authority, judged.root};
  if (judged.valid) {
    if (judged.external) {
      check_order(stamped, agrees, judged.ordering);
    }
    compare_clocks(token, judged.external);
    valid_.push_back(stamped);
    valid_checkpoints_.insert(token.checkpoint);
    if (judged.external && token.checkpoint > 0) {
      outside_.push_back(stamped);
      outside_times_.push_back(now);
      outside_entries_ = std::max(outside_entries_, token.checkpoint);
    }
  }
}

TimeProof TokenRules::time(std::uint64_t last_claim) const {
  if (!outside_.empty()) {
    return outside_entries_ > last_claim ? TimeProof::kExternal : TimeProof::kExternalInPart;
  }
  return valid_.empty() ? TimeProof::kNone : TimeProof::kSelfIssued;
}

std::optional<std::string> TokenRules::read_token(const TokenEntry& token, std::uint64_t entry) {
  const Place place{token.file, entry};
  const FileOpening opening = folder_->open_file(token.file);
  if (!opening.file) {
    report_unopened(*findings_, place, opening);
    return std::nullopt;
  }
  try {
    std::optional<std::string> response = read_small(*opening.file, kMaximumTokenBytes);
    if (!response || crypto::sha256(bytes_of(*response)) != token.sha256) {
      findings_->add("file-hash-differs", place,
                     token.file + " is not the file whose hash " + at_entry(entry) + " states");
      return std::nullopt;
    }
    return response;
  } catch (const IoError& error) {
    findings_->add("file-unreadable", place, std::string(error.what()) + "; so it was not checked");
    return std::nullopt;
  }
}

TokenRules::Judged TokenRules::judge(const TokenEntry& token, std::uint64_t entry,
                                     const std::string& response) {
  const Place place{token.file, entry};
  if (!checkpoints_->has(token.checkpoint)) {
    findings_->add(
        "checkpoint-missing", {note_path(token.checkpoint), entry},
        note_path(token.checkpoint) + " is not there, which the token of " + at_entry(entry) + " is over");
    return {};
  }
  const std::optional<std::string> note = read_note(*folder_, token.checkpoint, entry, *findings_);
  if (!note) {
    return {};
  }
  if (checkpoints_->hash_at(token.checkpoint) != crypto::sha256(bytes_of(*note))) {
    findings_->add("file-hash-differs", {note_path(token.checkpoint), entry},
                   note_path(token.checkpoint) +
                       " changed while it was checked: the token is over other bytes than those of which the "
                       "signature was verified");
    return {};
  }
  static const timestamp::TrustStore kNoTrust;
  timestamp::Expectation expectation;
  expectation.data = to_bytes(*note);
  const timestamp::TokenJudgement judgement = timestamp::judge_token(
      bytes_of(response), expectation, options_->trust == nullptr ? kNoTrust : *options_->trust);
  bool restated = false;
  if (judgement.info) {
    restated = compare_entry(token, entry, *judgement.info);
    // Said also where the chain could not be judged: the imprint needs no trust.
    const bool other_imprint =
        judgement.info->algorithm &&
        crypto::digest(*judgement.info->algorithm, *expectation.data) != judgement.info->imprint;
    if (other_imprint || judgement.code == timestamp::TokenCode::kImprintDiffers) {
      findings_->add("token-imprint-differs", place,
                     token.file + " is a token over something else than " + note_path(token.checkpoint));
      return {};
    }
  }
  switch (timestamp::verdict_of(judgement.code)) {
    case timestamp::TokenVerdict::kRefused:
      findings_->add("token-refused", place,
                     token.file + " does not hold (" + std::string(timestamp::code_name(judgement.code)) +
                         "): " + judgement.explanation);
      return {};
    case timestamp::TokenVerdict::kCouldNotCheck:
      if (judgement.code == timestamp::TokenCode::kNoTrust) {
        no_trust_ = true;
      } else {
        untrusted_.push_back({token.checkpoint, entry, token.file, shortened(judgement.explanation)});
      }
      return {false, false, restated};
    case timestamp::TokenVerdict::kValid:
      break;
  }
  const crypto::Sha256Digest root = crypto::sha256(judgement.chain.back());
  return {true, judgement.authority == timestamp::TimeAuthority::kOutside, restated,
          judgement.info && judgement.info->ordering, std::string(text_of(root))};
}

bool TokenRules::compare_entry(const TokenEntry& token, std::uint64_t entry,
                               const timestamp::TokenInfo& info) {
  bool same = true;
  const auto differs = [&](const std::string& field, const std::string& stated, const std::string& real) {
    same = false;
    findings_->add(
        "token-entry-differs", {std::string(kLedgerFile), entry},
        at_entry(entry) + " states " + field + " " + stated + " where " + token.file + " has " + real);
  };
  if (token.gen_time != info.gen_time) {
    differs("gen_time", format_utc(token.gen_time), format_utc(info.gen_time));
  }
  if (token.accuracy_ns != info.accuracy_ns) {
    differs("accuracy_ns", std::to_string(token.accuracy_ns), std::to_string(info.accuracy_ns));
  }
  if (token.serial != info.serial) {
    differs("serial", token.serial, info.serial);
  }
  return same;
}

bool TokenRules::restate_tokens(std::uint64_t first, std::uint64_t end) const {
  for (std::uint64_t entry = first; entry < end; ++entry) {
    if (!restating_.contains(entry)) {
      return false;
    }
  }
  return true;
}

void TokenRules::Order::add(StampedToken token) {
  const bool later = latest_.empty() || tokens_[latest_.back()].earliest() < token.earliest();
  latest_.push_back(later ? tokens_.size() : latest_.back());
  tokens_.push_back(std::move(token));
}

const StampedToken* TokenRules::Order::latest_below(std::uint64_t size) const {
  const auto covered = std::partition_point(tokens_.begin(), tokens_.end(),
                                            [&](const StampedToken& a) { return a.entry < size; });
  return covered == tokens_.begin()
             ? nullptr
             : &tokens_[latest_[static_cast<std::size_t>(covered - tokens_.begin()) - 1]];
}

namespace {

std::string breach_of(const StampedToken& now, const StampedToken& before) {
  return token_path(now.checkpoint, now.authority) + " says " + format_utc(now.gen_time) +
         ", yet it covers " + at_entry(before.entry) + " with the token of " + before.authority + " of " +
         format_utc(before.gen_time);
}

}  // namespace

// A token that covers another was made later, whatever the ledger says: where it says otherwise, a clock was
// wrong. That of the recorder's own authority is the recorder's, which check_elapsed() looks at.
void TokenRules::check_order(const StampedToken& now, bool agrees, bool ordering) {
  Order& order = order_of_[now.root];
  const StampedToken* before = order.latest_below(now.checkpoint);
  // RFC 3161 2.4.2: an authority that states `ordering` can always be held to it.
  const std::int64_t slack_ns = ordering ? 0 : kSlackNs;
  if (agrees && before != nullptr && ns_of(before->earliest() - now.latest()) > slack_ns) {
    findings_->add("token-order", {token_path(now.checkpoint, now.authority), now.entry},
                   breach_of(now, *before) + ": its clock was set back");
  }
  order.add(now);
}

void TokenRules::compare_authorities() {
  Order order;
  Pace pace;
  std::uint64_t recoveries = 0;
  for (std::size_t i = 0; i < outside_.size(); ++i) {
    const StampedToken& token = outside_[i];
    const Place place{outside_times_[i].file, token.entry};
    const StampedToken* before = order.latest_below(token.checkpoint);
    const bool breach = before != nullptr && before->root != token.root &&
                        ns_of(before->earliest() - token.latest()) > kSlackNs;
    if (breach) {
      findings_->add("authorities-disagree", place,
                     breach_of(token, *before) + ": the clock of one of the two is wrong");
    }
    order.add(token);
    const Earlier& now = outside_times_[i];
    if (!now.earliest_ns) {
      continue;
    }
    if (std::exchange(recoveries, now.recoveries) != now.recoveries) {
      pace = {};
    }
    const std::optional<Difference> found = pace.difference(now);
    if (found && found->before.root != now.root && !breach) {
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

void TokenRules::leave_out(const std::set<std::string>& roots) {
  const auto is_left_out = [&](const auto& token) { return roots.contains(token.root); };
  std::erase_if(outside_, is_left_out);
  std::erase_if(outside_times_, is_left_out);
  std::erase_if(valid_, is_left_out);
  outside_entries_ = 0;
  for (const StampedToken& token : outside_) {
    outside_entries_ = std::max(outside_entries_, token.checkpoint);
  }
}

// Each comparison allows for two seconds. Were a token compared with the one before alone, whoever asks for
// one a second could leave out as much as they like. Nor is it the ledger's name for an authority that
// decides which are compared.
bool TokenRules::check_elapsed(const TokenEntry& token, const Earlier& now) {
  if (!now.earliest_ns) {
    return true;  // over a checkpoint that is not there, or before an excerpt
  }
  Pace& pace = pace_of_[now.root.empty() ? token.authority : now.root];
  const std::optional<Difference> found = pace.difference(now);
  if (!now.stands) {
    const bool goes_on = pace.last && !found;
    if (!goes_on) {
      pace = {};
    }
    pace.add(now);
    if (now.external) {
      std::vector<Span>& agreeing = agreeing_[now.root];
      if (goes_on) {
        agreeing.back().end_ns = now.mono_ns;
      } else {
        agreeing.push_back({now.mono_ns, now.mono_ns});
      }
    }
  }
  if (!found) {
    return true;
  }
  const Place place{token.file, now.entry};
  const std::int64_t from_ns = found->before.mono_ns;
  if (now.external) {
    contradictions_.push_back({place,
                               Pace::text(*found, now),
                               now.root,
                               {from_ns, now.mono_ns},
                               found->elapsed_us > found->longest_us,
                               found->excess_us});
  } else {
    disagreements_.push_back({place, Pace::text(*found, now), from_ns, now.mono_ns, found->excess_us});
  }
  return false;
}

std::string TokenRules::Pace::text(const Difference& found, const Earlier& now) {
  return "between " + found.before.file + " in " + at_entry(found.before.entry) + " and " + now.file +
         " in " + at_entry(now.entry) + " the authorities' time went on by " + seconds(found.elapsed_us) +
         " and the case clock by " + seconds(found.shortest_us) + " to " + seconds(found.longest_us);
}

void TokenRules::Pace::add(const Earlier& token) {
  last = token;
  const std::int64_t drift_us = (*token.earliest_ns / kDriftDivisor + token.slewed_ns) / kNsPerUs;
  const std::int64_t gen_us = token.gen_time.time_since_epoch().count();
  const std::int64_t accuracy_us = token.accuracy_ns / kNsPerUs;
  const std::int64_t ahead_us = gen_us - accuracy_us - token.latest_ns / kNsPerUs + drift_us;
  const std::int64_t behind_us = *token.earliest_ns / kNsPerUs - gen_us - accuracy_us + drift_us;
  if (!most_ahead || ahead_us > most_ahead->first) {
    most_ahead.emplace(ahead_us, token);
  }
  if (!most_behind || behind_us > most_behind->first) {
    most_behind.emplace(behind_us, token);
  }
}

std::optional<TokenRules::Difference> TokenRules::Pace::difference(const Earlier& now) const {
  for (const Earlier* before : {last ? &*last : nullptr, most_ahead ? &most_ahead->second : nullptr,
                                most_behind ? &most_behind->second : nullptr}) {
    if (before == nullptr) {
      continue;
    }
    const std::int64_t longest_ns = now.latest_ns - *before->earliest_ns;
    Difference found;
    found.before = *before;
    found.shortest_us = (*now.earliest_ns - before->latest_ns) / kNsPerUs;
    found.longest_us = longest_ns / kNsPerUs;
    found.elapsed_us = (now.gen_time - before->gen_time).count();
    const std::int64_t tolerance_us = (kSlackNs + before->accuracy_ns + now.accuracy_ns +
                                       longest_ns / kDriftDivisor + (now.slewed_ns - before->slewed_ns)) /
                                      kNsPerUs;
    found.excess_us = std::max(found.shortest_us - tolerance_us - found.elapsed_us,
                               now.stands ? 0 : found.elapsed_us - found.longest_us - tolerance_us);
    if (found.excess_us > 0) {
      return found;
    }
  }
  return std::nullopt;
}

bool TokenRules::is_confirmed(const Contradiction& one) const {
  return std::any_of(agreeing_.begin(), agreeing_.end(), [&](const auto& each) {
    const auto& [root, spans] = each;
    return root != one.root && std::any_of(spans.begin(), spans.end(), [&](const Span& span) {
             return span.start_ns <= one.span.start_ns && one.span.end_ns <= span.end_ns;
           });
  });
}

// An authority may set its own clock right, and who holds the device key may state a case clock of their own.
// One authority cannot tell the two apart: what it says then proves no time, as if it had not been asked. Two
// that do not know of each other do not set theirs at the same time, by the same way.
void TokenRules::report_contradictions() {
  std::set<std::string> was_set;
  for (const Contradiction& one : contradictions_) {
    const bool shared =
        std::any_of(contradictions_.begin(), contradictions_.end(), [&](const Contradiction& other) {
          return other.root != one.root && other.ahead == one.ahead &&
                 other.span.start_ns < one.span.end_ns && one.span.start_ns < other.span.end_ns;
        });
    const bool stated =
        static_cast<double>(one.excess_us) * kNsPerUs <= stepped_ns(one.span.start_ns, one.span.end_ns);
    if (shared && stated) {
      findings_->add("authority-clock-differs", one.place,
                     one.text +
                         ", which is how far the wall clock was set: the case clock stood, as in a "
                         "virtual machine that was paused, or was made up");
    } else if (shared) {
      findings_->add("clock-contradicted", one.place, one.text + ", and so did another authority's");
    } else if (is_confirmed(one)) {
      findings_->add("authority-clock-set", one.place,
                     one.text + ", and that of another authority as the case clock");
      was_set.insert(one.root);
    } else {
      findings_->add("authority-clock-differs", one.place, one.text + ": one of the two was set");
    }
  }
  leave_out(was_set);
  // Where an authority alone differs, that was said.
  const bool all_are_out = std::ranges::all_of(
      contradictions_, [&](const Contradiction& one) { return was_set.contains(one.root); });
  if (all_are_out) {
    compare_authorities();
  }
}

void TokenRules::take_missed(const TokenMissedEntry& missed, std::uint64_t entry) {
  missed_after_close_ = missed_after_close_ || (close_ && missed.checkpoint > *close_);
  findings_->add("token-missed", {std::string(kLedgerFile), entry},
                 missed.authority + " did not stamp the checkpoint of " + std::to_string(missed.checkpoint) +
                     " entries: " + missed.cause);
}

void TokenRules::take_recovered() {
  pace_of_.clear();
  ++recoveries_;
}

void TokenRules::take_rate(std::int64_t rate_ppb, std::int64_t mono_ns) {
  const std::int64_t stated = std::min(std::abs(rate_ppb), kFastestSlewPpb);
  const std::int64_t rate = stated > kSlewPpb ? stated : 0;
  // The entry at a slew's end states its mean rate.
  slew_.rate_ppb = std::max(slew_.rate_ppb, rate);
  slew_.total_ns = slewed_until(mono_ns);
  slew_.since_ns = std::max(slew_.since_ns, mono_ns);
  slew_.rate_ppb = rate;
}

double TokenRules::stepped_ns(std::int64_t from_ns, std::int64_t until_ns) const {
  const auto steps_before = [&](std::int64_t mono_ns) {
    const auto first = std::partition_point(steps_.begin(), steps_.end(),
                                            [&](const Step& step) { return step.mono_ns < mono_ns; });
    return stepped_before_[static_cast<std::size_t>(first - steps_.begin())];
  };
  return steps_before(until_ns + kStepStatedWithinNs + 1) - steps_before(from_ns - kStepStatedWithinNs);
}

void TokenRules::report_disagreements() {
  for (const Disagreement& each : disagreements_) {
    if (static_cast<double>(each.excess_us) * kNsPerUs > stepped_ns(each.from_ns, each.until_ns)) {
      findings_->add("clock-disagreement", each.place, each.text);
    }
  }
}

std::int64_t TokenRules::slewed_until(std::int64_t mono_ns) const {
  const double elapsed = static_cast<double>(std::max<std::int64_t>(mono_ns - slew_.since_ns, 0));
  constexpr double kMostNs = 1e15;  // of a rate that is nonsense
  return slew_.total_ns +
         static_cast<std::int64_t>(std::min(elapsed * static_cast<double>(slew_.rate_ppb) / 1e9, kMostNs));
}

// The case clock goes on from the request to the entry, so this can only be false of entries that were made
// up.
void TokenRules::check_exchange(const TokenEntry& token, std::uint64_t entry, std::int64_t mono_ns) {
  if (!token.exchange) {
    return;
  }
  const auto [asked_ns, answered_ns] = *token.exchange;
  const std::int64_t signed_ns = checkpoints_->mono_at(token.checkpoint).value_or(0);
  if (asked_ns < signed_ns || answered_ns < asked_ns || mono_ns < answered_ns) {
    findings_->add(
        "token-exchange-impossible", {std::string(kLedgerFile), entry},
        at_entry(entry) + " states that " + token.file +
            " was asked for and answered at a time that is not between its checkpoint and its entry");
  }
}

void TokenRules::compare_clocks(const TokenEntry& token, bool outside) {
  if (!token.exchange || recoveries_ > 0) {
    return;
  }
  const auto [asked_ns, answered_ns] = *token.exchange;
  const bool whole_seconds = token.gen_time == std::chrono::floor<std::chrono::seconds>(token.gen_time);
  const ClockComparison comparison{
      token.gen_time, asked_ns + (answered_ns - asked_ns) / 2,
      (answered_ns - asked_ns + 1) / 2 + token.accuracy_ns + (whole_seconds ? 1'000'000'000 : 0)};
  const auto [known, first] = clock_of_.emplace(std::pair(token.authority, outside), clocks_.size());
  if (first) {
    clocks_.push_back({token.authority, outside, 1, comparison, comparison});
  } else {
    ++clocks_[known->second].comparisons;
    clocks_[known->second].last = comparison;
  }
}

void TokenRules::finish(bool whole_case) {
  std::sort(steps_.begin(), steps_.end(), [](const Step& a, const Step& b) { return a.mono_ns < b.mono_ns; });
  stepped_before_ = {0};
  for (const Step& step : steps_) {
    stepped_before_.push_back(stepped_before_.back() + std::abs(static_cast<double>(step.step_ns)));
  }
  report_contradictions();
  report_disagreements();
  if (count_ == 0) {
    findings_->add("no-token", {},
                   "there is no time-stamp token: only the device's own clock says when this was");
  } else if (no_trust_) {
    findings_->add("no-trusted-authority", {},
                   "no trusted time-stamping root was given, so the tokens prove no time");
  }
  for (const Untrusted& token : untrusted_) {
    const Place place{token.file, token.entry};
    const std::string text = token.file + " could not be judged: " + token.explanation;
    if (valid_checkpoints_.contains(token.checkpoint)) {
      findings_->add("second-token-untrusted", place, text);
    } else {
      findings_->add("token-untrusted", place, text);
    }
  }
  if (whole_case && count_ > 0 && close_ && largest_checkpoint_ <= *close_ && !missed_after_close_) {
    findings_->add(
        "end-not-stamped", {std::string(kLedgerFile), close_},
        "no token covers close in " + at_entry(*close_) + ": when the end was written is not proven");
  }
}

std::vector<Bracket> TokenRules::brackets(std::uint64_t first, std::uint64_t entries) const {
  // Beside an outside clock the recorder's own would only seem to make the brackets narrower.
  return brackets_of(outside_.empty() ? valid_ : outside_, first, entries);
}

}  // namespace kiroku::archive

#include "archive/verify/token_rules.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/format/limits.h"
#include "archive/verify/file_checker.h"
#include "archive/verify/found_files.h"
#include "base/error.h"
#include "base/printable.h"

namespace kiroku::archive {

namespace {

std::string at_entry(std::uint64_t entry) { return "entry " + std::to_string(entry); }

}  // namespace

TokenRules::TokenRules(const CaseFolder& folder, const VerifyOptions& options, FindingList& findings,
                       const CheckpointRules& checkpoints)
    : folder_(&folder),
      options_(&options),
      findings_(&findings),
      checkpoints_(&checkpoints),
      clock_rules_(findings) {}

void TokenRules::take(const TokenEntry& token, std::uint64_t entry, std::int64_t mono_ns) {
  ++count_;
  hashes_[entry] = token.sha256;
  const Place place{token.file, entry};
  const std::string own = token_path(token.checkpoint, token.authority, TokenForm::kResponse);
  const std::string shared = token_path(token.checkpoint, token.authority, TokenForm::kShared);
  if (token.file != own && token.file != shared) {
    findings_->add("token-name-differs", place,
                   at_entry(entry) + " names " + token.file + " where " + own + " or " + shared + " must be");
    return;
  }
  if (!entered_.emplace(token.checkpoint, token.authority).second) {
    findings_->add("token-repeated", place,
                   at_entry(entry) + " enters a second token of " + token.authority +
                       " over the checkpoint of " + std::to_string(token.checkpoint) + " entries, " +
                       token.file);
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

  TimedToken now;
  now.file = token.file;
  now.written_ns = now.latest_ns = mono_ns;
  now.earliest_ns = checkpoints_->mono_at(token.checkpoint);
  now.external = judged.valid && judged.external;
  now.ordering = judged.ordering;
  now.is_over_end = close_ && token.checkpoint > *close_;
  now.stands = now.is_over_end && !token.exchange;
  check_exchange(token, entry, mono_ns);
  if (token.exchange) {
    now.earliest_ns = token.exchange->asked_ns;
    now.latest_ns = token.exchange->answered_ns;
  }
  const StampedToken stamped{
      entry,           token.checkpoint, token.gen_time, token.accuracy_ns,
      token.authority, judged.root,      token.file,     judged.valid && judged.external,
      mono_ns};
  now.stamped = stamped;
  if (judged.valid) {
    compare_clocks(token, now);
  }
  clock_rules_.take(std::move(now));
  if (judged.valid) {
    authorities_.try_emplace(judged.root, StampingAuthority{judged.subject, judged.external, 0, {}});
    valid_.push_back(stamped);
    valid_checkpoints_.insert(token.checkpoint);
    const bool is_outside = judged.external && token.checkpoint > 0;
    if (is_outside) {
      outside_.push_back(stamped);
    }
    // Of other entries than are here it says when those existed: of these it proves nothing.
    if (checkpoints_->fits(token.checkpoint)) {
      proving_.push_back(stamped);
      if (is_outside) {
        proving_outside_.push_back(stamped);
        outside_entries_ = std::max(outside_entries_, token.checkpoint);
      }
    }
  }
}

TimeProof TokenRules::time(std::uint64_t first_claim, std::uint64_t last_claim) const {
  if (outside_entries_ > last_claim) {
    return TimeProof::kExternal;
  }
  if (outside_entries_ > first_claim) {
    return TimeProof::kExternalInPart;
  }
  return proving_.size() == proving_outside_.size() ? TimeProof::kNone : TimeProof::kSelfIssued;
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
    const Place of_note{note_path(token.checkpoint), entry};
    if (checkpoints_->all_listed()) {
      findings_->add("checkpoint-missing", of_note,
                     of_note.file + " is not there, which the token of " + at_entry(entry) + " is over");
    } else {
      findings_->add("file-unreadable", of_note,
                     std::string(kCheckpointsFolder) + " cannot be read, so " + of_note.file +
                         " was not checked, which the token of " + at_entry(entry) + " is over");
    }
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
  const TokenForm form = token.file == token_path(token.checkpoint, token.authority, TokenForm::kShared)
                             ? TokenForm::kShared
                             : TokenForm::kResponse;
  std::string why;
  auto judging = judging_of(form, bytes_of(response), bytes_of(*note), why);
  if (!judging) {
    findings_->add("token-refused", place, token.file + " does not hold as a shared token: " + why);
    return {};
  }
  judging->expectation.judge_strangers = strangers_ < kMostJudgedStrangers;
  judging->expectation.pool = &pool_;
  const timestamp::TokenJudgement judgement = timestamp::judge_token(
      judging->token, judging->expectation, options_->trust == nullptr ? kNoTrust : *options_->trust);
  strangers_ += judgement.code == timestamp::TokenCode::kValid ? 0 : 1;
  bool restated = false;
  if (judgement.info) {
    restated = compare_entry(token, entry, *judgement.info);
    // Said also where the chain could not be judged: the imprint needs no trust.
    const bool other_imprint = judgement.info->algorithm && !judging->is_over_data(*judgement.info);
    if (other_imprint || judgement.code == timestamp::TokenCode::kImprintDiffers) {
      findings_->add(
          "token-imprint-differs", place,
          token.file + " is a token over something else than " + note_path(token.checkpoint) +
              (form == TokenForm::kShared ? ": its hash tree does not lead from there to what was stamped"
                                          : ""));
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
  for (const timestamp::SignatureUse& use : judgement.signatures) {
    if (std::ranges::find(signatures_, use) == signatures_.end()) signatures_.push_back(use);
  }
  const crypto::Sha256Digest root = crypto::sha256(judgement.chain.back());
  return {true,
          judgement.authority == timestamp::TimeAuthority::kOutside,
          restated,
          judgement.info && judgement.info->ordering,
          std::string(text_of(root)),
          judgement.root_subject};
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

void TokenRules::leave_out(const std::set<std::string>& roots) {
  const auto is_left_out = [&](const StampedToken& token) { return roots.contains(token.root); };
  for (std::vector<StampedToken>* tokens : {&valid_, &outside_, &proving_, &proving_outside_}) {
    std::erase_if(*tokens, is_left_out);
  }
  outside_entries_ = 0;
  for (const StampedToken& token : proving_outside_) {
    outside_entries_ = std::max(outside_entries_, token.checkpoint);
  }
}

void TokenRules::take_recovered() {
  recovered_ = true;
  clock_rules_.take_recovered();
}

void TokenRules::take_missed(const TokenMissedEntry& missed, std::uint64_t entry) {
  missed_after_close_ = missed_after_close_ || (close_ && missed.checkpoint > *close_);
  findings_->add("token-missed", {std::string(kLedgerFile), entry},
                 missed.authority + " did not stamp the checkpoint of " + std::to_string(missed.checkpoint) +
                     " entries: " + in_quotation_marks(missed.cause));
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

void TokenRules::compare_clocks(const TokenEntry& token, const TimedToken& timed) {
  if (!timed.earliest_ns || timed.stands || recovered_) {
    return;
  }
  const std::int64_t asked_ns = *timed.earliest_ns;
  const std::int64_t round_trip_ns = timed.latest_ns - asked_ns;
  const bool whole_seconds = token.gen_time == std::chrono::floor<std::chrono::seconds>(token.gen_time);
  const ClockComparison comparison{
      token.gen_time, asked_ns + round_trip_ns / 2,
      (round_trip_ns + 1) / 2 + token.accuracy_ns + (whole_seconds ? 1'000'000'000 : 0)};
  if (timed.external) {
    first_outside_.try_emplace(token.authority, comparison);
  }
  if (!token.exchange) {
    return;
  }
  const auto [known, first] = clock_of_.emplace(std::pair(token.authority, timed.external), clocks_.size());
  if (first) {
    clocks_.push_back({token.authority, timed.external, 1, comparison, comparison});
  } else {
    ++clocks_[known->second].comparisons;
    clocks_[known->second].last = comparison;
  }
}

std::vector<StampingAuthority> TokenRules::authorities() const {
  std::vector<StampingAuthority> all;
  std::map<std::string, std::size_t> place_of;  // by root
  std::set<std::pair<std::string, std::string>> named;
  for (const StampedToken& token : proving_) {
    const auto [place, first] = place_of.emplace(token.root, all.size());
    if (first) {
      all.push_back(authorities_.at(token.root));
    }
    StampingAuthority& its = all[place->second];
    ++its.tokens;
    if (named.emplace(token.root, token.authority).second) {
      its.names.push_back(token.authority);
    }
  }
  return all;
}

std::vector<ProvingToken> TokenRules::proving() const {
  std::vector<ProvingToken> all;
  auto outside = proving_outside_.begin();  // both in the ledger's order
  for (const StampedToken& token : proving_) {
    const bool is_outside = outside != proving_outside_.end() && outside->entry == token.entry;
    all.push_back({token.entry, is_outside});
    outside += is_outside ? 1 : 0;
  }
  return all;
}

std::optional<StampedToken> TokenRules::first_after_close() const {
  const bool all_after = close_ && std::ranges::all_of(outside_, [&](const StampedToken& token) {
                           return token.checkpoint > *close_;
                         });
  const auto first = std::ranges::min_element(outside_, {}, &StampedToken::gen_time);
  return all_after && first != outside_.end() ? std::optional(*first) : std::nullopt;
}

std::optional<StampedToken> TokenRules::first_entered() const {
  const auto first = std::ranges::min_element(outside_, {}, &StampedToken::entry);
  return first == outside_.end() ? std::nullopt : std::optional(*first);
}

void TokenRules::finish(bool whole_case, bool from_open) {
  leave_out(clock_rules_.finish(from_open));
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
  return brackets_of(proving_outside_.empty() ? proving_ : proving_outside_, first, entries);
}

}  // namespace kiroku::archive

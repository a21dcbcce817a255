#include "evidence/record_verifier.h"

#include <algorithm>
#include <map>
#include <set>

#include "evidence/hash_tree.h"

namespace kiroku::evidence {
namespace {

/// Clocks of authority and verifier may differ by so much before a time-stamp counts as one of the future.
constexpr std::chrono::minutes kClockSlack{5};

/// The hash of a token's imprint, also one that does not count any more.
std::optional<crypto::HashAlgorithm> hash_of(const timestamp::TokenInfo& info) {
  return info.algorithm_name == crypto::hash_name(crypto::HashAlgorithm::kSha224)
             ? crypto::HashAlgorithm::kSha224
             : info.algorithm;
}

/// RFC 4998: over the DER of tokens and chains.
class DerCover : public RenewalCover {
 public:
  explicit DerCover(const EvidenceRecord& record) : record_(record) {}
  Bytes time_stamp(std::size_t chain, std::size_t index, crypto::HashAlgorithm algorithm) override {
    return crypto::digest(algorithm, record_.chains[chain][index].token);
  }
  Bytes chains_before(std::size_t chain, crypto::HashAlgorithm algorithm) override {
    for (; encoded_ < chain; ++encoded_) append(chains_, encode_chain(record_.chains[encoded_]));
    return crypto::digest(algorithm, sequence_of_chains(chains_));
  }
  ObjectValues object(const DataObject& object, std::size_t /*chain*/,
                      crypto::HashAlgorithm algorithm) override {
    ObjectValues values{.bytes = object.digest(algorithm), .canonical = {}};
    values.is_partial = !values.bytes;
    return values;
  }
  [[nodiscard]] bool joins_objects_and_chains() const override { return true; }

 private:
  const EvidenceRecord& record_;
  Bytes chains_;  // their DER, one behind the other
  std::size_t encoded_ = 0;
};

class RecordJudge {
 public:
  RecordJudge(const EvidenceRecord& record, const std::vector<DataObject>& objects, const JudgingRules& rules,
              RenewalCover& cover)
      : record_(record),
        cover_(cover),
        objects_(objects),
        rules_(rules),
        no_ends_(Policy::without_ends()),
        policy_(rules.policy != nullptr ? *rules.policy : no_ends_) {
    out_.covered_from.resize(objects.size());
    out_.only_as_canonical.resize(objects.size());
  }

  RecordJudgement judge() {
    for (std::size_t chain = 0; chain < record_.chains.size(); ++chain) judge_chain(chain);
    judge_order();
    judge_ends();
    return std::move(out_);
  }

 private:
  const ArchiveTimeStamp& time_stamp(const TimeStampJudgement& judged) const {
    return record_.chains[judged.chain][judged.index];
  }
  void add(const std::string& code, Standing standing, std::string place, std::string text) {
    out_.problems.push_back({code, standing, std::move(place), std::move(text)});
  }

  void judge_chain(std::size_t chain);
  void judge_token(TimeStampJudgement& judged, const std::optional<Bytes>& root);
  /// The first time-stamp of a chain against the data; the root that its token must be over.
  std::optional<Bytes> judge_beginning(TimeStampJudgement& judged, crypto::HashAlgorithm algorithm);
  /// What the first time-stamp of a chain must hold: one of the values of each object. `joined`: the hash of
  /// the chains before, where that is a part of each value.
  std::vector<ObjectValues> values_of_objects(std::size_t chain, crypto::HashAlgorithm algorithm,
                                              const std::optional<Bytes>& joined);
  /// `chains`: the hash of the chains before, where it is a value of its own.
  void match_objects(TimeStampJudgement& judged, const HashList& list,
                     const std::vector<ObjectValues>& values, const std::optional<Bytes>& chains);
  /// The same where there is no list: the token is over one object. The value that it is over, or should be.
  std::optional<Bytes> match_one(TimeStampJudgement& judged, const ObjectValues& values);
  void add_not_read(const std::string& name, const ObjectValues& values, const std::string& place);
  void judge_order();
  void judge_ends();
  void judge_end_of(const TimeStampJudgement& judged, const std::string& place, UtcTime time, bool newest);
  void judge_term(const Term& term, const std::string& what, bool of_data_hash, const std::string& place,
                  UtcTime time, bool newest);
  [[nodiscard]] std::optional<UtcTime> time_of_chain(std::size_t chain) const;

  const EvidenceRecord& record_;
  RenewalCover& cover_;
  const std::vector<DataObject>& objects_;
  const JudgingRules& rules_;
  const Policy no_ends_;
  const Policy& policy_;
  timestamp::CertificatePool pool_;
  std::size_t strangers_ = 0;
  RecordJudgement out_;
};

void RecordJudge::judge_chain(std::size_t chain) {
  std::optional<crypto::HashAlgorithm> algorithm;
  for (std::size_t index = 0; index < record_.chains[chain].size(); ++index) {
    const ArchiveTimeStamp& here = record_.chains[chain][index];
    const std::string place = place_of(chain, index);
    TimeStampJudgement judged;
    judged.chain = chain;
    judged.index = index;
    judged.kind = index > 0   ? StampKind::kTimeStampRenewal
                  : chain > 0 ? StampKind::kHashTreeRenewal
                              : StampKind::kFirst;

    // The hash algorithm: the field's, else the token's; the same in the whole chain.
    std::string ignored;
    const auto info = timestamp::parse_token_info(here.token, ignored);
    const std::optional<crypto::HashAlgorithm> own =
        here.digest_algorithm ? here.digest_algorithm->algorithm : (info ? hash_of(*info) : std::nullopt);
    judged.algorithm = here.digest_algorithm ? here.digest_algorithm->name
                       : info                ? info->algorithm_name
                                             : std::string("unknown");
    if (!own) {
      add("record-algorithm-unknown", Standing::kRefused, place,
          "the hash algorithm of " + place + ", " + judged.algorithm +
              ", is none that counts here: SHA-2 and SHA-3 of at least 256 bits do");
      judge_token(judged, std::nullopt);
      out_.time_stamps.push_back(std::move(judged));
      continue;
    }
    if (!algorithm) algorithm = own;
    if (*algorithm != *own) {
      add("record-algorithm-differs", Standing::kRefused, place,
          place + " hashes with " + judged.algorithm + ", its chain with " +
              std::string(crypto::hash_name(*algorithm)));
    }

    // What the first list must hold.
    std::optional<Bytes> root;
    if (index > 0) {
      const Bytes previous = cover_.time_stamp(chain, index - 1, *own);
      const bool alone = here.reduced_tree.empty();
      judged.covers_previous =
          alone || std::ranges::find(here.reduced_tree.front(), previous) != here.reduced_tree.front().end();
      root = alone ? previous : root_of(*own, here.reduced_tree);
      if (!judged.covers_previous) {
        add("record-link-missing", Standing::kRefused, place,
            place +
                " does not cover the time-stamp before it: one was cut out, put elsewhere, or is another "
                "record's");
      }
    } else {
      root = judge_beginning(judged, *own);
    }
    judge_token(judged, root);
    out_.time_stamps.push_back(std::move(judged));
  }
}

std::optional<Bytes> RecordJudge::judge_beginning(TimeStampJudgement& judged,
                                                  crypto::HashAlgorithm algorithm) {
  const ArchiveTimeStamp& here = time_stamp(judged);
  const std::string place = place_of(judged.chain, judged.index);
  std::optional<Bytes> before;
  if (judged.chain > 0) before = cover_.chains_before(judged.chain, algorithm);
  const bool joined = cover_.joins_objects_and_chains();
  const auto values = values_of_objects(judged.chain, algorithm, joined ? before : std::nullopt);
  const std::optional<Bytes> chains = joined ? std::nullopt : before;
  if (!here.reduced_tree.empty()) {
    const HashList& first = here.reduced_tree.front();
    const std::size_t said_before = out_.problems.size();
    if (chains) {
      judged.covers_previous = std::ranges::find(first, *chains) != first.end();
      if (!judged.covers_previous) {
        add("record-link-missing", Standing::kRefused, place,
            place +
                " does not cover the chains before it: one was cut out, put elsewhere, or is another "
                "record's");
      }
    }
    match_objects(judged, first, values, chains);
    // One value alone is no hash of data and chains, whatever the token is over. Of data that may join later
    // nothing was missed above.
    if (chains && first.size() == 1) {
      if (out_.problems.size() == said_before)
        add("record-data-not-covered", Standing::kCouldNotCheck, place,
            place + " covers the chains before it alone, and " +
                (values.empty() ? "no data was given that it could cover"
                                : "none of the data that was given and may have joined later"));
      return {};
    }
    return root_of(algorithm, here.reduced_tree);
  }
  if (chains) {
    judged.covers_previous = true;
    add("record-data-not-covered", Standing::kRefused, place,
        place + " has no hash tree, so it cannot cover both the data and the chains before it");
  } else if (values.size() != 1) {
    add("record-data-not-covered", values.empty() ? Standing::kCouldNotCheck : Standing::kRefused, place,
        place + " has no hash tree, so it covers one object, and " + std::to_string(values.size()) +
            " were given");
  } else {
    return match_one(judged, values.front());
  }
  return {};
}

std::optional<Bytes> RecordJudge::match_one(TimeStampJudgement& judged, const ObjectValues& values) {
  std::string ignored;
  const auto info = timestamp::parse_token_info(time_stamp(judged).token, ignored);
  for (const std::optional<Bytes>* value : {&values.bytes, &values.canonical}) {
    if (!*value || !info || info->imprint != **value) continue;
    match_objects(judged, {**value}, {values}, {});
    return **value;
  }
  if (values.is_partial) {
    add_not_read(objects_.front().name, values, place_of(judged.chain, judged.index));
    return {};
  }
  const Bytes& value = values.canonical ? *values.canonical : *values.bytes;
  match_objects(judged, {value}, {values}, {});
  return value;
}

void RecordJudge::add_not_read(const std::string& name, const ObjectValues& values,
                               const std::string& place) {
  add("record-data-not-read", Standing::kCouldNotCheck, place,
      name + " could not be read" + (values.why.empty() ? "" : " as XML, since " + values.why) +
          ", so whether " + place + " covers it is not known");
}

std::vector<ObjectValues> RecordJudge::values_of_objects(std::size_t chain, crypto::HashAlgorithm algorithm,
                                                         const std::optional<Bytes>& joined) {
  std::vector<ObjectValues> values;
  values.reserve(objects_.size());
  for (const DataObject& object : objects_) {
    ObjectValues its = cover_.object(object, chain, algorithm);
    for (std::optional<Bytes>* value : {&its.bytes, &its.canonical}) {
      if (!*value || !joined) continue;
      append(**value, *joined);
      *value = crypto::digest(algorithm, **value);
    }
    values.push_back(std::move(its));
  }
  return values;
}

void RecordJudge::match_objects(TimeStampJudgement& judged, const HashList& list,
                                const std::vector<ObjectValues>& values, const std::optional<Bytes>& chains) {
  constexpr std::size_t kMostNamed = 3;
  const HeldValues held(list);
  std::set<Bytes> known;
  if (chains && held.contains(*chains)) known.insert(*chains);
  std::size_t missing = 0;
  std::string names;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const bool has_bytes = values[i].bytes && held.contains(*values[i].bytes);
    const bool has_canonical = values[i].canonical && held.contains(*values[i].canonical);
    if (has_bytes) known.insert(*values[i].bytes);
    if (has_canonical) known.insert(*values[i].canonical);
    if (has_bytes || has_canonical) {
      judged.objects.push_back(i);
      if (!has_bytes) out_.only_as_canonical[i] = true;
      if (!out_.covered_from[i]) out_.covered_from[i] = judged.chain;
      continue;
    }
    if (values[i].is_partial) {
      add_not_read(objects_[i].name, values[i], place_of(judged.chain, judged.index));
      continue;
    }
    // What joins later may be missing before, never afterwards.
    if (rules_.objects_may_join && !out_.covered_from[i] && judged.chain + 1 < record_.chains.size())
      continue;
    if (missing++ < kMostNamed) names += (names.empty() ? "" : ", ") + objects_[i].name;
  }
  judged.other_values = held.size() - known.size();
  if (missing == 0) return;
  if (missing > kMostNamed) names += " and " + std::to_string(missing - kMostNamed) + " more";
  const std::string place = place_of(judged.chain, judged.index);
  add("record-data-not-covered", Standing::kRefused, place,
      place + " does not cover " + names + (judged.chain > 0 ? " together with the chains before it" : "") +
          ": it is of other data, or these bytes are not those that were time-stamped");
}

void RecordJudge::judge_token(TimeStampJudgement& judged, const std::optional<Bytes>& root) {
  static const timestamp::TrustStore kNobody;
  const ArchiveTimeStamp& here = time_stamp(judged);
  const std::string place = place_of(judged.chain, judged.index);
  const timestamp::TrustStore& trust = rules_.trust != nullptr ? *rules_.trust : kNobody;
  timestamp::Expectation expectation;
  expectation.judge_strangers = strangers_ < kMostJudgedStrangers;
  expectation.pool = &pool_;
  judged.token = timestamp::judge_token(here.token, expectation, trust);
  strangers_ += judged.token.code == timestamp::TokenCode::kValid ? 0 : 1;
  if (root && judged.token.info) {
    const bool same_hash =
        !here.digest_algorithm || here.digest_algorithm->algorithm == hash_of(*judged.token.info);
    judged.imprint_fits = same_hash && judged.token.info->imprint == *root;
    if (!judged.imprint_fits) {
      add("record-imprint-differs", Standing::kRefused, place,
          "the token of " + place +
              (same_hash ? " is over another root than that of its hash tree"
                         : " is over a " + judged.token.info->algorithm_name + " hash, its tree is of " +
                               judged.algorithm));
    }
  }
  const timestamp::TokenVerdict verdict = timestamp::verdict_of(judged.token.code);
  if (verdict != timestamp::TokenVerdict::kValid) {
    add(std::string(timestamp::code_name(judged.token.code)),
        verdict == timestamp::TokenVerdict::kRefused ? Standing::kRefused : Standing::kCouldNotCheck, place,
        "the token of " + place + " does not count: " + judged.token.explanation);
  }
}

void RecordJudge::judge_order() {
  const TimeStampJudgement* before = nullptr;
  for (const TimeStampJudgement& judged : out_.time_stamps) {
    if (!judged.token.info) continue;
    if (before != nullptr && judged.token.info->gen_time < before->token.info->gen_time) {
      const std::string place = place_of(judged.chain, judged.index);
      add("record-out-of-order", Standing::kRefused, place,
          place + " is of " + format_utc(judged.token.info->gen_time) + ", before the one that it renews, " +
              format_utc(before->token.info->gen_time));
    }
    before = &judged;
  }
  if (before != nullptr && before->token.info->gen_time > rules_.now + kClockSlack) {
    const std::string place = place_of(before->chain, before->index);
    add("record-from-the-future", Standing::kCouldNotCheck, place,
        place + " is of " + format_utc(before->token.info->gen_time) + ", and it is " +
            format_utc(rules_.now) + " by this machine's clock: set the clock");
  }
}

std::optional<UtcTime> RecordJudge::time_of_chain(std::size_t chain) const {
  for (const TimeStampJudgement& judged : out_.time_stamps) {
    if (judged.chain == chain && judged.index == 0 && judged.token.info) return judged.token.info->gen_time;
  }
  return {};
}

void RecordJudge::judge_ends() {
  for (std::size_t i = 0; i < out_.time_stamps.size(); ++i) {
    const TimeStampJudgement& judged = out_.time_stamps[i];
    const std::string place = place_of(judged.chain, judged.index);
    const bool newest = i + 1 == out_.time_stamps.size();
    const auto next = newest ? std::optional(rules_.now)
                      : out_.time_stamps[i + 1].token.info
                          ? std::optional(out_.time_stamps[i + 1].token.info->gen_time)
                          : std::nullopt;
    if (next && judged.token.code == timestamp::TokenCode::kValid) judge_end_of(judged, place, *next, newest);
    // Of the data's hash the whole chain is judged at once, where it ends.
    if (judged.index + 1 != record_.chains[judged.chain].size()) continue;
    const bool last_chain = judged.chain + 1 == record_.chains.size();
    const auto until = last_chain ? std::optional(rules_.now) : time_of_chain(judged.chain + 1);
    if (until) {
      judge_term(policy_.hash(judged.algorithm), judged.algorithm, true, place_of(judged.chain, 0), *until,
                 last_chain);
    }
  }
}

void RecordJudge::judge_end_of(const TimeStampJudgement& judged, const std::string& place, UtcTime time,
                               bool newest) {
  if (judged.token.valid_until) {
    const Term term{true, judged.token.valid_until};
    judge_term(term, "a certificate of " + judged.token.signer_subject, false, place, time, newest);
  }
  for (const timestamp::SignatureUse& use : judged.token.signatures) {
    judge_term(policy_.signature(use), words_of(use), false, place, time, newest);
  }
}

void RecordJudge::judge_term(const Term& term, const std::string& what, bool of_data_hash,
                             const std::string& place, UtcTime time, bool newest) {
  if (!term.listed) {
    add("record-algorithm-not-listed", Standing::kRefused, place,
        place + " rests on " + what + ", which the policy '" + policy_.name() + "' does not list");
    return;
  }
  if (!term.end) return;
  if (newest && (!out_.end || *term.end < out_.end->time)) {
    out_.end = RecordJudgement::End{*term.end, what};
  }
  if (newest && of_data_hash) out_.data_hash_end = term.end;
  if (time < *term.end) return;
  const std::string since = format_utc(*term.end);
  if (newest) {
    add("record-lapsed", Standing::kCouldNotCheck, place,
        place + " rests on " + what + ", which ended at " + since +
            ", and nothing renewed it before: it proves nothing any more");
  } else {
    add("record-renewed-too-late", Standing::kRefused, place,
        place + " rests on " + what + ", which ended at " + since + ", and the next time-stamp came at " +
            format_utc(time) + ", after that");
  }
}

}  // namespace

Standing RecordJudgement::standing() const {
  Standing worst = Standing::kHolds;
  for (const Problem& problem : problems) worst = std::max(worst, problem.standing);
  return worst;
}

std::optional<UtcTime> RecordJudgement::since() const {
  if (time_stamps.empty() || !time_stamps.front().token.info) return {};
  return time_stamps.front().token.info->gen_time;
}

std::optional<UtcTime> RecordJudgement::newest() const {
  if (time_stamps.empty() || !time_stamps.back().token.info) return {};
  return time_stamps.back().token.info->gen_time;
}

bool RecordJudgement::outside() const {
  return !time_stamps.empty() && std::ranges::all_of(time_stamps, [](const TimeStampJudgement& judged) {
    return judged.token.code == timestamp::TokenCode::kValid &&
           judged.token.authority == timestamp::TimeAuthority::kOutside;
  });
}

RecordJudgement judge_record(const EvidenceRecord& record, const std::vector<DataObject>& objects,
                             const JudgingRules& rules) {
  DerCover cover(record);
  return judge_record(record, objects, rules, cover);
}

RecordJudgement judge_record(const EvidenceRecord& record, const std::vector<DataObject>& objects,
                             const JudgingRules& rules, RenewalCover& cover) {
  return RecordJudge(record, objects, rules, cover).judge();
}

std::optional<crypto::HashAlgorithm> hash_of_chain(const ArchiveTimeStampChain& chain) {
  const ArchiveTimeStamp& first = chain.front();
  if (first.digest_algorithm) return first.digest_algorithm->algorithm;
  std::string ignored;
  const auto info = timestamp::parse_token_info(first.token, ignored);
  return info ? info->algorithm : std::nullopt;
}

}  // namespace kiroku::evidence

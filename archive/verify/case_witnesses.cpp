#include "archive/verify/case_witnesses.h"

#include <algorithm>
#include <chrono>
#include <tuple>
#include <utility>

#include "archive/format/case_layout.h"

namespace kiroku::archive {

namespace {

using Holds = WitnessReport::Holds;

struct Candidate {
  std::string name;
  const std::string* note;
  crypto::Checkpoint checkpoint;
  std::vector<crypto::VerifierKey> signers;
  Holds holds;
  bool is_reached;  // from what is here
};

/// Whether the policy is for this log at all: not for that of another key of the same name. Those who signed
/// it are trusted.
bool is_meant(const crypto::WitnessPolicy& policy, const Candidate& candidate) {
  return policy.logs().empty() || std::ranges::any_of(policy.logs(), [&](const auto& log) {
           return log_origin(log.key.name()) == candidate.checkpoint.origin &&
                  std::ranges::find(candidate.signers, log.key) != candidate.signers.end();
         });
}

Holds held_by(const WalkedLog& log, const crypto::Checkpoint& checkpoint) {
  if (log.closed && log.closed->entry < checkpoint.size) {
    return Holds::kEnd;
  }
  return log.opened && *log.opened < checkpoint.size ? Holds::kBeginning : Holds::kNothing;
}

/// Whether what the log states of the case reaches all that is here, up to its end: by a root of its own, or
/// by a proof that leads to the very end that it states.
bool reaches(const WalkedLog& log, const LogProof& proof, const ShownPart& part) {
  const auto& proved = proof.proved();
  const bool is_proved =
      proved && log.closed && proved->end.size == log.closed->size && proved->end.root == log.closed->root;
  return is_proved || part.known >= std::min(part.size, log.closed ? log.closed->size : part.size);
}

std::uint64_t now_s(const VerifyOptions& options) {
  const UtcTime now = options.now.value_or(utc_now());
  return static_cast<std::uint64_t>(std::max<std::int64_t>(
      0, std::chrono::duration_cast<std::chrono::seconds>(now.time_since_epoch()).count()));
}

}  // namespace

std::string_view holds_name(Holds holds) {
  switch (holds) {
    case Holds::kEnd:
      return "end";
    case Holds::kBeginning:
      return "beginning";
    case Holds::kNothing:
      break;
  }
  return "nothing";
}

crypto::CountedCosignatures counted_cosignatures(const VerifyOptions& options) {
  if (options.policy == nullptr) {
    return {};
  }
  const UtcTime now = options.now.value_or(utc_now());
  const bool hash = options.policy->hash("sha256").holds_at(now);
  return {hash && options.policy->signature({"ed25519", 0, ""}).holds_at(now),
          hash && options.policy->signature({"ml-dsa-44", 0, ""}).holds_at(now)};
}

std::optional<std::string> why_cosignatures_ended(const VerifyOptions& options,
                                                  const crypto::WitnessPolicy& witnesses) {
  const crypto::CountedCosignatures counted = counted_cosignatures(options);
  if (!counted.any()) {
    return "cosignatures prove nothing any more: SHA-256, or Ed25519 and ML-DSA-44, ended by the policy of "
           "algorithms or are not listed there";
  }
  const auto uses = [&](crypto::CosignatureAlgorithm algorithm) {
    return std::ranges::any_of(witnesses.witnesses(),
                               [&](const auto& each) { return each.key.algorithm() == algorithm; });
  };
  for (const auto& [algorithm, name] : {std::pair(crypto::CosignatureAlgorithm::kEd25519, "Ed25519"),
                                        std::pair(crypto::CosignatureAlgorithm::kMlDsa44, "ML-DSA-44")}) {
    if (!counted.of(algorithm) && uses(algorithm)) {
      return std::string("cosignatures by ") + name +
             " prove nothing any more: it ended by the policy of algorithms, or is not listed there";
    }
  }
  return std::nullopt;
}

WalkedLog walked_log(const LogContents& contents, OutsideNotes& notes,
                     const std::optional<OpenEntry>& opening) {
  WalkedLog walked{notes.held_notes(), std::nullopt, std::nullopt};
  const auto known = opening ? contents.cases.find(opening->case_id) : contents.cases.end();
  // What another device's log tells of the case, its own has not said.
  const bool is_anothers = contents.opened_by_another && contents.opened_by_another->accuses;
  if (known != contents.cases.end() && known->second.opened && !is_anothers) {
    walked.opened = known->second.opened;
    walked.closed = known->second.closed;
  }
  return walked;
}

std::optional<WitnessReport> judge_case_witnesses(const VerifyOptions& options,
                                                  const std::optional<WalkedLog>& log, const LogProof& proof,
                                                  const std::optional<ShownPart>& part) {
  if (options.witnesses == nullptr) {
    return std::nullopt;
  }
  const crypto::WitnessPolicy& policy = *options.witnesses;
  WitnessReport report;
  report.asks_for_none = policy.asks_for_none();
  const bool is_own = std::ranges::any_of(
      options.devices, [&](const auto& device) { return policy.has_witness_with(device.key()); });
  if (is_own) {
    report.unused.push_back(
        "the policy names a device's own key as a witness: whoever signs a log does not witness it");
    return report;
  }
  const crypto::CountedCosignatures counted = counted_cosignatures(options);
  // The log's end says nothing of an excerpt's lines where nothing leads from them to it.
  const bool is_reached = !part || !log || reaches(*log, proof, *part);
  std::vector<Candidate> candidates;
  if (const auto& proved = proof.proved()) {
    candidates.push_back({proved->name, &proved->note, proved->log, {proved->signer}, Holds::kEnd, true});
  }
  if (log) {
    for (const OutsideNotes::Held& note : log->notes) {
      candidates.push_back(
          {note.name, &note.text, note.checkpoint, note.signers, held_by(*log, note.checkpoint), is_reached});
    }
  }
  const auto rank = [](const WitnessReport& each) {
    return std::tuple(each.holds, each.witnessed.quorum, each.entries);
  };
  for (const Candidate& candidate : candidates) {
    const auto leave_out = [&](const std::string& why) {
      report.unused.push_back(candidate.name + " says nothing of witnesses here: " + why);
    };
    if (candidate.holds == Holds::kNothing) {
      leave_out("its " + std::to_string(candidate.checkpoint.size) +
                " entries of the log say nothing of the case");
      continue;
    }
    if (!candidate.is_reached) {
      leave_out("the excerpt leads to the case's first " + std::to_string(part->size) +
                " entries, and the log states the root of " + std::to_string(part->known) +
                " of them: nobody witnessed the others. A proof by 'kiroku log prove' of the excerpt leads "
                "to the case's end");
      continue;
    }
    if (!is_meant(policy, candidate)) {
      leave_out("the policy names logs, and this one is none of them");
      continue;
    }
    WitnessReport told = report;
    told.holds = candidate.holds;
    told.note = candidate.name;
    told.entries = candidate.checkpoint.size;
    told.witnessed = crypto::judge_witnesses(policy, *candidate.note, now_s(options), counted);
    if (report.note.empty() || rank(told) > rank(report)) {
      report = std::move(told);
    }
  }
  if (auto ended = why_cosignatures_ended(options, policy); ended && !report.note.empty()) {
    report.witnessed.quorum = report.witnessed.quorum && counted.any();
    report.unused.push_back(std::move(*ended));
  }
  return report;
}

}  // namespace kiroku::archive

#include "apps/verify/witness_judgement.h"

#include <algorithm>
#include <chrono>
#include <optional>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "archive/format/case_layout.h"
#include "archive/verify/case_witnesses.h"
#include "archive/verify/report_json.h"
#include "archive/writing/log_reading.h"
#include "base/json_or_null.h"
#include "base/number_text.h"
#include "base/printable.h"
#include "base/utc_time.h"
#include "crypto/merkle_tree.h"

namespace kiroku::apps {
namespace {

using State = crypto::CosignatureCheck::State;

struct Candidate {
  const archive::OutsideNote* note;
  crypto::Checkpoint checkpoint;
  bool holds = false;
  std::optional<UtcTime> utc_behind;  // of the entry that follows its entries
};

/// A note of this log by this device; why not, into `unused`.
std::optional<Candidate> candidate_of(const archive::OutsideNote& note, const crypto::VerifierKey& device,
                                      std::vector<std::string>& unused) {
  const crypto::OpenedNote opened = crypto::open_note(note.text, {device});
  const auto checkpoint = crypto::Checkpoint::parse(opened.text);
  // What the device signed before it had an ML-DSA key is compared with the log, which is judged by itself.
  if (!checkpoint || !crypto::is_signed_for_log(opened, device, checkpoint->size)) {
    unused.push_back(note.name + " says nothing of witnesses: it is no checkpoint that the device signed");
    return std::nullopt;
  }
  if (checkpoint->origin != archive::log_origin(device.name())) {
    unused.push_back(note.name + " says nothing of witnesses: it is of \"" + printable(checkpoint->origin) +
                     "\", not of this log");
    return std::nullopt;
  }
  if (checkpoint->size == 0) {
    // Every history goes on from nothing.
    unused.push_back(note.name + " says nothing of witnesses: it is of a log without entries");
    return std::nullopt;
  }
  return Candidate{&note, *checkpoint, false, std::nullopt};
}

/// Why a note tells nothing of the entries that are here.
std::string misfit_of(const Candidate& candidate, std::uint64_t entries) {
  const std::uint64_t stated = candidate.checkpoint.size;
  const std::string says_nothing = candidate.note->name + " says nothing of witnesses here: ";
  if (stated > entries) {
    return says_nothing + "it is of " + counted(stated, "entry", "entries") + ", and here are " +
           std::to_string(entries) + ". Entries were taken away, or this is a copy from before";
  }
  return says_nothing + "it was not signed of the entries that this log begins with";
}

std::string when(std::uint64_t time_s) {
  return format_local(UtcTime(std::chrono::seconds(static_cast<std::int64_t>(time_s))));
}

}  // namespace

std::string witnessed_words(bool asks_for_none, bool quorum) {
  // A quorum of nobody is no witness.
  if (asks_for_none) return "not asked to be witnessed by the policy";
  return quorum ? "witnessed as the policy asks" : "NOT witnessed as the policy asks";
}

std::string cosigner_words(const crypto::WitnessedNote::Cosigner& cosigner) {
  switch (cosigner.check.state) {
    case State::kValid:
      return printable(cosigner.name) + " cosigned, at " + when(cosigner.check.time_s) + " by its clock";
    case State::kInvalid:
      return printable(cosigner.name) +
             ": a line in its name does not hold, or is of a time that has not come";
    case State::kAbsent:
      break;
  }
  return printable(cosigner.name) + " did not cosign";
}

bool is_of_log(const archive::OutsideNote& note, const crypto::VerifierKey& device) {
  std::vector<std::string> why;
  return candidate_of(note, device, why).has_value();
}

WitnessJudgement judge_log_witnesses(const std::filesystem::path& log_folder,
                                     const crypto::VerifierKey& device, const crypto::WitnessPolicy& policy,
                                     const std::vector<archive::OutsideNote>& notes,
                                     const archive::VerifyOptions& options) {
  WitnessJudgement judgement;
  judgement.witnessed.quorum = judgement.asks_for_none = policy.asks_for_none();
  const auto& logs = policy.logs();
  const bool is_meant =
      logs.empty() || std::ranges::any_of(logs, [&](const auto& log) { return log.key == device; });
  if (!is_meant) {
    judgement.witnessed.quorum = false;
    judgement.unused.push_back("the policy names logs, and this device's key is none of them");
    return judgement;
  }
  if (policy.has_witness_with(device.key())) {
    judgement.witnessed.quorum = false;
    judgement.unused.push_back(
        "the policy names the device's own key as a witness: whoever signs a log does not witness it");
    return judgement;
  }
  std::vector<Candidate> candidates;
  for (const archive::OutsideNote& note : notes) {
    if (auto candidate = candidate_of(note, device, judgement.unused))
      candidates.push_back(std::move(*candidate));
  }
  std::ranges::sort(candidates, {}, [](const Candidate& each) { return each.checkpoint.size; });
  crypto::MerkleFrontier tree;
  auto next = candidates.begin(), last_reached = next;
  archive::for_each_log_line(log_folder, [&](const archive::LogLine& line) {
    // The first entry behind what was reached with the entry before.
    for (; last_reached != next; ++last_reached) last_reached->utc_behind = line.utc;
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
    for (; next != candidates.end() && next->checkpoint.size == tree.size(); ++next)
      next->holds = next->checkpoint.root == tree.root();
  });
  judgement.log_entries = tree.size();
  const auto now = std::chrono::duration_cast<std::chrono::seconds>(utc_now().time_since_epoch()).count();
  const crypto::CountedCosignatures counting = archive::counted_cosignatures(options);
  for (const Candidate& candidate : candidates) {
    if (!candidate.holds) {
      judgement.unused.push_back(misfit_of(candidate, tree.size()));
      continue;
    }
    crypto::WitnessedNote witnessed =
        crypto::judge_witnesses(policy, candidate.note->text, static_cast<std::uint64_t>(now), counting);
    // In the order of their entries: a later one tells more, unless it lacks the quorum that an earlier one
    // has.
    if (judgement.witnessed.quorum && !witnessed.quorum) continue;
    judgement.note = candidate.note->name;
    judgement.entries = candidate.checkpoint.size;
    judgement.first_unwitnessed = candidate.utc_behind;
    judgement.witnessed = std::move(witnessed);
  }
  if (auto ended = archive::why_cosignatures_ended(options, policy)) {
    judgement.witnessed.quorum = judgement.witnessed.quorum && counting.any();
    judgement.unused.push_back(std::move(*ended));
  }
  return judgement;
}

std::string WitnessJudgement::text() const {
  std::string text;
  if (note.empty()) {
    text = "Witnesses: nothing shows that anybody cosigned this log.\n";
  } else {
    text = std::string("Witnesses: the first ") + std::to_string(entries) + " of " +
           counted(log_entries, "entry", "entries") + (entries == 1 ? " is " : " are ") +
           witnessed_words(asks_for_none, witnessed.quorum) + " (" + printable(note) + ").\n";
    if (first_unwitnessed) {
      const std::uint64_t rest = log_entries - entries;
      text += std::string("  Of the ") + (rest == 1 ? "one" : std::to_string(rest)) +
              " behind them only the device speaks: from " + format_local(*first_unwitnessed) + " on.\n";
    }
    for (const crypto::WitnessedNote::Cosigner& cosigner : witnessed.cosigners)
      text += "  " + cosigner_words(cosigner) + "\n";
  }
  if (asks_for_none) text += "  The policy asks for no witness, so none is needed.\n";
  for (const std::string& why : unused) text += "  " + printable(why) + "\n";
  return text;
}

nlohmann::ordered_json WitnessJudgement::json() const {
  return {{"quorum", witnessed.quorum},
          {"note", note.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(note)},
          {"asks_for_none", asks_for_none},
          {"entries", entries},
          {"log_entries", log_entries},
          {"unwitnessed_since", or_null(first_unwitnessed)},
          {"witnesses", archive::cosigners_json(witnessed)},
          {"unused", unused}};
}

}  // namespace kiroku::apps

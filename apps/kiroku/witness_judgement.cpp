#include "apps/kiroku/witness_judgement.h"

#include <algorithm>
#include <chrono>
#include <optional>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "archive/format/case_layout.h"
#include "archive/writing/appliance_log.h"
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
};

/// A note of this log by this device; why not, into `unused`.
std::optional<Candidate> candidate_of(const archive::OutsideNote& note, const crypto::VerifierKey& device,
                                      std::vector<std::string>& unused) {
  const crypto::OpenedNote opened = crypto::open_note(note.text, {device});
  const auto checkpoint = crypto::Checkpoint::parse(opened.text);
  if (opened.failure || !checkpoint) {
    unused.push_back(note.name + " says nothing of witnesses: it is no checkpoint that the device signed");
    return std::nullopt;
  }
  if (checkpoint->origin != archive::log_origin(device.name())) {
    unused.push_back(note.name + " says nothing of witnesses: it is of \"" + printable(checkpoint->origin) +
                     "\", not of this log");
    return std::nullopt;
  }
  return Candidate{&note, *checkpoint};
}

std::string when(std::uint64_t time_s) {
  return format_local(UtcTime(std::chrono::seconds(static_cast<std::int64_t>(time_s))));
}

std::string sentence_of(const crypto::WitnessedNote::Cosigner& cosigner) {
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

}  // namespace

WitnessJudgement judge_log_witnesses(const std::filesystem::path& log_folder,
                                     const crypto::VerifierKey& device, const crypto::WitnessPolicy& policy,
                                     const std::vector<archive::OutsideNote>& notes) {
  WitnessJudgement judgement;
  judgement.witnessed.quorum = policy.asks_for_none();
  const auto& logs = policy.logs();
  const bool is_meant =
      logs.empty() || std::ranges::any_of(logs, [&](const auto& log) { return log.key == device; });
  if (!is_meant) {
    judgement.witnessed.quorum = false;
    judgement.unused.push_back("the policy names logs, and this device's key is none of them");
    return judgement;
  }
  std::vector<Candidate> candidates;
  for (const archive::OutsideNote& note : notes) {
    if (auto candidate = candidate_of(note, device, judgement.unused))
      candidates.push_back(std::move(*candidate));
  }
  std::ranges::sort(candidates, {}, [](const Candidate& each) { return each.checkpoint.size; });
  crypto::MerkleFrontier tree;
  auto next = candidates.begin();
  const auto compare = [&] {
    for (; next != candidates.end() && next->checkpoint.size <= tree.size(); ++next)
      next->holds = next->checkpoint.size == tree.size() && next->checkpoint.root == tree.root();
  };
  compare();
  archive::for_each_log_line(log_folder, [&](const archive::LogLine& line) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
    compare();
  });
  const auto now = std::chrono::duration_cast<std::chrono::seconds>(utc_now().time_since_epoch()).count();
  for (const Candidate& candidate : candidates) {
    if (!candidate.holds) {
      judgement.unused.push_back(candidate.note->name +
                                 " says nothing of witnesses here: it was not signed of the "
                                 "entries that this log begins with");
      continue;
    }
    crypto::WitnessedNote witnessed =
        crypto::judge_witnesses(policy, candidate.note->text, static_cast<std::uint64_t>(now));
    // In the order of their entries: a later one tells more, unless it lacks the quorum that an earlier one
    // has.
    if (judgement.witnessed.quorum && !witnessed.quorum) continue;
    judgement.note = candidate.note->name;
    judgement.entries = candidate.checkpoint.size;
    judgement.witnessed = std::move(witnessed);
  }
  return judgement;
}

std::string WitnessJudgement::text() const {
  std::string text;
  if (note.empty()) {
    text = "Witnesses: nothing shows that anybody cosigned this log.\n";
  } else {
    text = std::string("Witnesses: the first ") + std::to_string(entries) +
           (entries == 1 ? " entry is " : " entries are ") + (witnessed.quorum ? "" : "NOT ") +
           "witnessed as the policy asks (" + printable(note) + ").\n";
    for (const crypto::WitnessedNote::Cosigner& cosigner : witnessed.cosigners)
      text += "  " + sentence_of(cosigner) + "\n";
  }
  for (const std::string& why : unused) text += "  " + why + "\n";
  return text;
}

nlohmann::ordered_json WitnessJudgement::json() const {
  nlohmann::ordered_json cosigners = nlohmann::ordered_json::array();
  for (const crypto::WitnessedNote::Cosigner& cosigner : witnessed.cosigners) {
    const State state = cosigner.check.state;
    cosigners.push_back({{"witness", cosigner.name},
                         {"cosigned", state == State::kValid},
                         {"invalid", state == State::kInvalid}});
    if (state == State::kValid) cosigners.back()["time_s"] = cosigner.check.time_s;
  }
  return {{"quorum", witnessed.quorum},
          {"note", note.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(note)},
          {"entries", entries},
          {"witnesses", cosigners},
          {"unused", unused}};
}

}  // namespace kiroku::apps

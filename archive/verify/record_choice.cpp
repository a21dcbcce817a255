#include "archive/verify/record_choice.h"

#include <algorithm>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "base/error.h"

namespace kiroku::archive {
namespace {

using crypto::HashAlgorithm;

/// A record as far as it can be judged without its case.
struct Candidate {
  std::size_t index = 0;
  std::optional<evidence::EvidenceRecord> record;
  evidence::Standing standing = evidence::Standing::kRefused;
  bool outside = false;
  std::optional<UtcTime> since, newest;

  /// What orders them: better ones are smaller.
  [[nodiscard]] auto rank() const {
    const UtcTime never = UtcTime::max(), first = UtcTime::min();
    const auto age = newest.value_or(first).time_since_epoch();
    return std::tuple(!record, standing, !outside, since.value_or(never), -age, index);
  }
};

Candidate judged_alone(std::size_t index, const Bytes& bytes, const evidence::JudgingRules& rules) {
  Candidate candidate;
  candidate.index = index;
  candidate.record = evidence::parse_record(bytes).record;
  if (!candidate.record) return candidate;
  const evidence::RecordJudgement judged = evidence::judge_record(*candidate.record, {}, rules);
  candidate.standing = judged.standing();
  candidate.outside = judged.outside();
  candidate.since = judged.since();
  candidate.newest = judged.newest();
  return candidate;
}

/// Compares records with one case.
class WholeJudge {
 public:
  WholeJudge(const CaseFolder& folder, const evidence::JudgingRules& rules)
      : folder_(folder), rules_(rules), data_(read_case_data(folder)) {}

  bool holds(const evidence::EvidenceRecord& record) {
    for (const evidence::ArchiveTimeStampChain& chain : record.chains) {
      if (const auto algorithm = evidence::hash_of_chain(chain)) take(*algorithm);
    }
    try {
      return judge_case_evidence(folder_, data_, record, rules_, taken_).refusal.empty();
    } catch (const Error&) {
      return false;  // of what it covers something cannot be read, or is not as the ledger states
    }
  }

 private:
  /// A file that cannot be read is no record's: judging one that covers it says so.
  void take(HashAlgorithm algorithm) {
    if (algorithm == HashAlgorithm::kSha256 || !hashed_.insert(algorithm).second) return;
    for (const NamedFile& named : data_.files) {
      if (!named.stated) continue;
      try {
        taken_.emplace(std::pair(named.file, algorithm), hash_named_file(folder_, named, algorithm));
      } catch (const Error&) {
        continue;
      }
    }
  }

  const CaseFolder& folder_;
  const evidence::JudgingRules& rules_;
  const CaseData data_;
  std::set<HashAlgorithm> hashed_;
  FileHashes taken_;
};

}  // namespace

RecordChoice choose_record(const CaseFolder& folder, const std::vector<Bytes>& records,
                           const evidence::JudgingRules& rules,
                           const std::function<bool(const crypto::Sha256Digest&)>& is_known_to_hold) {
  std::vector<Candidate> candidates;
  candidates.reserve(records.size());
  for (std::size_t i = 0; i < records.size(); ++i) candidates.push_back(judged_alone(i, records[i], rules));
  std::ranges::sort(candidates, {}, &Candidate::rank);
  std::optional<WholeJudge> judge;
  for (const Candidate& each : candidates) {
    if (each.standing != evidence::Standing::kHolds) break;
    if (is_known_to_hold && is_known_to_hold(crypto::sha256(records[each.index]))) return {each.index, true};
    if (!judge) judge.emplace(folder, rules);
    if (judge->holds(*each.record)) return {each.index, true};
  }
  return {candidates.front().index, false};
}

}  // namespace kiroku::archive

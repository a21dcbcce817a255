#include "evidence/renewal.h"

#include <algorithm>
#include <map>

#include "base/error.h"
#include "evidence/hash_tree.h"

namespace kiroku::evidence {
namespace {

ArchiveTimeStamp made_time_stamp(crypto::HashAlgorithm algorithm, std::vector<HashList> tree, Bytes token) {
  ArchiveTimeStamp made;
  made.digest_algorithm = named_hash(algorithm);
  made.reduced_tree = std::move(tree);
  made.token = std::move(token);
  return made;
}

crypto::HashAlgorithm algorithm_of(const ArchiveTimeStampChain& chain) {
  if (const auto algorithm = hash_of_chain(chain)) return *algorithm;
  throw UsageError("an evidence record whose hash algorithm is not known here cannot be renewed");
}

}  // namespace

std::vector<ArchiveTimeStamp> stamp_groups(crypto::HashAlgorithm algorithm, std::vector<HashList> groups,
                                           const Stamp& stamp) {
  const std::size_t count = groups.size();
  const HashTree tree(algorithm, std::move(groups));
  const Bytes token = stamp(algorithm, tree.root());
  std::vector<ArchiveTimeStamp> made;
  made.reserve(count);
  for (std::size_t i = 0; i < count; ++i) made.push_back(made_time_stamp(algorithm, tree.reduced(i), token));
  return made;
}

std::vector<EvidenceRecord> begin_records(crypto::HashAlgorithm algorithm, std::vector<HashList> groups,
                                          const Stamp& stamp) {
  std::vector<EvidenceRecord> records;
  records.reserve(groups.size());
  for (ArchiveTimeStamp& first : stamp_groups(algorithm, std::move(groups), stamp)) {
    EvidenceRecord record;
    record.digest_algorithms.push_back(named_hash(algorithm));
    record.chains.push_back({std::move(first)});
    records.push_back(std::move(record));
  }
  return records;
}

NewestTimeStamp newest_of(const EvidenceRecord& record) {
  const crypto::HashAlgorithm algorithm = algorithm_of(record.chains.back());
  return {algorithm, crypto::digest(algorithm, record.chains.back().back().token)};
}

std::vector<EvidenceRecord> renew_time_stamps(std::vector<EvidenceRecord> records, const Stamp& stamp) {
  std::map<crypto::HashAlgorithm, std::pair<std::vector<std::size_t>, std::vector<HashList>>> by_algorithm;
  for (std::size_t i = 0; i < records.size(); ++i) {
    NewestTimeStamp newest = newest_of(records[i]);
    auto& [members, groups] = by_algorithm[newest.algorithm];
    members.push_back(i);
    groups.push_back({std::move(newest.hash)});
  }
  for (auto& [algorithm, of_one_hash] : by_algorithm) {
    auto& [members, groups] = of_one_hash;
    std::vector<ArchiveTimeStamp> made = stamp_groups(algorithm, std::move(groups), stamp);
    for (std::size_t k = 0; k < members.size(); ++k) {
      records[members[k]].chains.back().push_back(std::move(made[k]));
    }
  }
  return records;
}

std::vector<EvidenceRecord> renew_hash_trees(std::vector<EvidenceRecord> records,
                                             crypto::HashAlgorithm algorithm,
                                             const std::vector<HashList>& groups, const Stamp& stamp) {
  if (groups.size() != records.size()) {
    throw UsageError("a hash-tree renewal needs the data of each record: " + std::to_string(groups.size()) +
                     " groups for " + std::to_string(records.size()) + " records");
  }
  std::vector<HashList> over_chains;
  over_chains.reserve(groups.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    Bytes chains;
    for (const ArchiveTimeStampChain& chain : records[i].chains) append(chains, encode_chain(chain));
    const Bytes before = crypto::digest(algorithm, sequence_of_chains(chains));
    HashList values;
    values.reserve(groups[i].size());
    for (Bytes value : groups[i]) {
      append(value, before);
      values.push_back(crypto::digest(algorithm, value));
    }
    over_chains.push_back(std::move(values));
  }
  std::vector<ArchiveTimeStamp> made = stamp_groups(algorithm, std::move(over_chains), stamp);
  for (std::size_t i = 0; i < records.size(); ++i) {
    const std::string name(crypto::hash_name(algorithm));
    if (std::ranges::find(records[i].digest_algorithms, name, &NamedHash::name) ==
        records[i].digest_algorithms.end()) {
      records[i].digest_algorithms.push_back(named_hash(algorithm));
    }
    records[i].chains.push_back({std::move(made[i])});
  }
  return records;
}

Due what_is_due(const RecordJudgement& judgement, const Policy& policy, UtcTime now) {
  Due due;
  if (!judgement.end) return due;
  due.before = judgement.end->time;
  due.reason = judgement.end->of + " ends at " + format_utc(judgement.end->time);
  if (now >= judgement.end->time) {
    due.what = Due::What::kTooLate;
    due.reason = judgement.end->of + " ended at " + format_utc(judgement.end->time);
    return due;
  }
  // The hash of the data may end soon, too, where something else ends sooner.
  const bool hash_ends = judgement.data_hash_end && now + policy.renew_before() >= *judgement.data_hash_end;
  if (hash_ends) {
    due.what = Due::What::kHashTreeRenewal;
    due.reason = judgement.time_stamps.back().algorithm + " ends at " + format_utc(*judgement.data_hash_end);
  } else if (now + policy.renew_before() >= judgement.end->time) {
    due.what = Due::What::kTimeStampRenewal;
  }
  return due;
}

}  // namespace kiroku::evidence

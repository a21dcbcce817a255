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
  std::string ignored;
  const ArchiveTimeStamp& first = chain.front();
  if (first.digest_algorithm) {
    if (first.digest_algorithm->algorithm) return *first.digest_algorithm->algorithm;
  } else if (const auto info = timestamp::parse_token_info(first.token, ignored); info && info->algorithm) {
    return *info->algorithm;
  }
  throw UsageError("an evidence record whose hash algorithm is not known here cannot be renewed");
}

}  // namespace

std::vector<EvidenceRecord> begin_records(crypto::HashAlgorithm algorithm,
                                          const std::vector<HashList>& groups, const Stamp& stamp) {
  const HashTree tree(algorithm, groups);
  const Bytes token = stamp(algorithm, tree.root());
  std::vector<EvidenceRecord> records;
  records.reserve(groups.size());
  for (std::size_t i = 0; i < groups.size(); ++i) {
    EvidenceRecord record;
    record.digest_algorithms.push_back(named_hash(algorithm));
    record.chains.push_back({made_time_stamp(algorithm, tree.reduced(i), token)});
    records.push_back(std::move(record));
  }
  return records;
}

std::vector<EvidenceRecord> renew_time_stamps(std::vector<EvidenceRecord> records, const Stamp& stamp) {
  std::map<crypto::HashAlgorithm, std::vector<std::size_t>> by_algorithm;
  for (std::size_t i = 0; i < records.size(); ++i) {
    by_algorithm[algorithm_of(records[i].chains.back())].push_back(i);
  }
  for (const auto& [algorithm, members] : by_algorithm) {
    std::vector<HashList> groups;
    groups.reserve(members.size());
    for (const std::size_t i : members) {
      groups.push_back({crypto::digest(algorithm, records[i].chains.back().back().token)});
    }
    const HashTree tree(algorithm, std::move(groups));
    const Bytes token = stamp(algorithm, tree.root());
    for (std::size_t k = 0; k < members.size(); ++k) {
      records[members[k]].chains.back().push_back(made_time_stamp(algorithm, tree.reduced(k), token));
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
  const HashTree tree(algorithm, std::move(over_chains));
  const Bytes token = stamp(algorithm, tree.root());
  for (std::size_t i = 0; i < records.size(); ++i) {
    const std::string name(crypto::hash_name(algorithm));
    if (std::ranges::find(records[i].digest_algorithms, name, &NamedHash::name) ==
        records[i].digest_algorithms.end()) {
      records[i].digest_algorithms.push_back(named_hash(algorithm));
    }
    records[i].chains.push_back({made_time_stamp(algorithm, tree.reduced(i), token)});
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

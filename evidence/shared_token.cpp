#include "evidence/shared_token.h"

#include <algorithm>
#include <utility>

#include "timestamp/der.h"

namespace kiroku::evidence {
namespace {

constexpr auto kHash = crypto::HashAlgorithm::kSha256;

EvidenceRecord record_of(const SharedToken& shared) {
  ArchiveTimeStamp only;
  only.digest_algorithm = named_hash(kHash);
  only.reduced_tree = shared.path;
  only.token = shared.token;
  EvidenceRecord record;
  record.digest_algorithms.push_back(named_hash(kHash));
  record.chains.push_back({std::move(only)});
  return record;
}

}  // namespace

bool begins_as_record(ByteView der) {
  const auto whole = timestamp::DerReader(der).next(timestamp::der::kSequence);
  return whole && timestamp::DerReader(whole->content).next(timestamp::der::kInteger).has_value();
}

std::optional<Bytes> SharedToken::imprint_for(ByteView digest) const {
  if (path.empty()) return to_bytes(digest);
  if (!HeldValues(path.front()).contains(digest)) return std::nullopt;
  return root_of(kHash, path);
}

bool SharedToken::begins_with(ByteView value) const {
  return !path.empty() && HeldValues(path.front()).contains(value);
}

SharedTokenParse parse_shared_token(ByteView der) {
  RecordParse parsed = parse_record(der);
  if (!parsed.record) return {{}, "it is no evidence record: " + parsed.explanation};
  std::vector<ArchiveTimeStampChain>& chains = parsed.record->chains;
  if (chains.size() != 1 || chains.front().size() != 1)
    return {{}, "it has more than one time-stamp, so that it would not be certain which counts"};
  ArchiveTimeStamp& only = chains.front().front();
  SharedToken shared{std::move(only.reduced_tree), std::move(only.token)};
  if (!std::ranges::equal(encode_record(record_of(shared)), der))
    return {{}, "it names another hash than SHA-256, or has more in it than one time-stamp"};
  const std::size_t size = crypto::digest(kHash, {}).size();
  for (const HashList& list : shared.path) {
    if (std::ranges::any_of(list, [&](const Bytes& value) { return value.size() != size; }))
      return {{}, "its hash tree has values that are no SHA-256"};
  }
  return {std::move(shared), {}};
}

StampedRound::StampedRound(std::vector<HashList> groups, const Stamp& stamp)
    : tree_(kHash, std::move(groups)), token_(stamp(kHash, tree_.root())) {}

Bytes StampedRound::file_of(std::size_t group) const {
  return encode_record(record_of({tree_.reduced(group), token_}));
}

bool StampJudging::is_over_data(const timestamp::TokenInfo& info) const {
  if (!info.algorithm) return false;
  if (expectation.data) return crypto::digest(*info.algorithm, *expectation.data) == info.imprint;
  return info.algorithm == expectation.algorithm && info.imprint == *expectation.imprint;
}

StampJudging judging_response(ByteView response_or_token, ByteView data) {
  StampJudging judging{to_bytes(response_or_token), {}};
  judging.expectation.data = to_bytes(data);
  return judging;
}

std::optional<StampJudging> judging_shared(ByteView record, ByteView data, std::string& explanation) {
  SharedTokenParse parsed = parse_shared_token(record);
  if (!parsed.shared) {
    explanation = std::move(parsed.explanation);
    return std::nullopt;
  }
  StampJudging judging;
  judging.expectation.algorithm = kHash;
  judging.expectation.imprint = parsed.shared->imprint_for(crypto::digest(kHash, data)).value_or(Bytes());
  judging.token = std::move(parsed.shared->token);
  return judging;
}

}  // namespace kiroku::evidence

// Beginning and renewing evidence records (RFC 4998 sections 4.2 and 5.2): one token for many records.
// Functions; thread-safe for different records, as far as `stamp` is.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "evidence/record_verifier.h"

namespace kiroku::evidence {

/// Gets a token (ContentInfo, DER) over this hash, which is judged already. What it throws comes through, and
/// then no record was changed.
using Stamp = std::function<Bytes(crypto::HashAlgorithm algorithm, ByteView imprint)>;

/// Time-stamps of one token over these groups of hash values: one for each, in their order, with its own
/// path. Throws kiroku::UsageError for no group, or an empty one.
std::vector<ArchiveTimeStamp> stamp_groups(crypto::HashAlgorithm algorithm, std::vector<HashList> groups,
                                           const Stamp& stamp);

/// A record for each group of hash values of data objects, in their order. One token. Throws
/// kiroku::UsageError for no group, or an empty one.
std::vector<EvidenceRecord> begin_records(crypto::HashAlgorithm algorithm, std::vector<HashList> groups,
                                          const Stamp& stamp);

/// What a time-stamp renewal covers: the hash of the newest token, under the hash of its chain.
struct NewestTimeStamp {
  crypto::HashAlgorithm algorithm = crypto::HashAlgorithm::kSha256;
  Bytes hash;
  friend bool operator==(const NewestTimeStamp&, const NewestTimeStamp&) = default;
};
/// Throws kiroku::UsageError for a chain whose hash is not known here.
NewestTimeStamp newest_of(const EvidenceRecord& record);

/// Time-stamp renewal: a new time-stamp in the last chain of each, over the one before it. One token for all
/// whose chains have one hash algorithm.
std::vector<EvidenceRecord> renew_time_stamps(std::vector<EvidenceRecord> records, const Stamp& stamp);

/// Hash-tree renewal: a new chain for each, over its data (hashed with `algorithm`, `groups` in the records'
/// order) and all chains before. One token.
std::vector<EvidenceRecord> renew_hash_trees(std::vector<EvidenceRecord> records,
                                             crypto::HashAlgorithm algorithm,
                                             const std::vector<HashList>& groups, const Stamp& stamp);

/// What a record needs.
struct Due {
  enum class What {
    kNothing,
    kTimeStampRenewal,
    kHashTreeRenewal,
    kTooLate,  // its newest time-stamp does not count any more: only a new record can begin
  };
  What what = What::kNothing;
  std::string reason;             // a phrase: what ends, and when
  std::optional<UtcTime> before;  // when it will be too late; nothing where no end is known
};
/// Of a record that holds, or that lapsed and has no other problem. Due is what ends within the policy's
/// renew_before().
Due what_is_due(const RecordJudgement& judgement, const Policy& policy, UtcTime now);

}  // namespace kiroku::evidence

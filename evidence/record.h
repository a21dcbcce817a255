// Evidence records (RFC 4998): the ASN.1 EvidenceRecord as a value, read and written with OpenSSL's
// templates. Reading judges form alone; evidence/record_verifier.h judges what a record proves. Pure
// functions, thread-safe.
//
//   EvidenceRecord            = version 1, digestAlgorithms, [0] cryptoInfos, [1] encryptionInfo, chains
//   ArchiveTimeStampChain     = time-stamps under one hash algorithm, each over the one before it
//   ArchiveTimeStamp          = [0] digestAlgorithm, [1] attributes, [2] reducedHashtree, timeStamp (a token)
//   reducedHashtree           = lists of hash values: the path from data objects to the token's imprint
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "crypto/hash.h"

namespace kiroku::evidence {

// What is beyond these limits is refused before memory is taken for it.
inline constexpr std::size_t kMaximumRecordBytes = 32U << 20U;
inline constexpr std::size_t kMostChains = 64;
inline constexpr std::size_t kMostTimeStamps = 512;  // of all chains together
inline constexpr std::size_t kMostHashLists = 64;    // of one reduced hash tree: 2^63 cases and more
inline constexpr std::size_t kMostAlgorithms = 64;   // of digestAlgorithms
// Each hash-tree renewal covers all chains before it, so these are hashed again for each. All together that
// may be so many times the bytes of all chains, and so many bytes more. A record whose chains are of one size
// may be renewed 16 times, of 100 kB each 23 times.
inline constexpr std::size_t kMostTimesHashedAgain = 8;
inline constexpr std::size_t kAlwaysHashedAgain = 8U << 20U;
/// Of a record's tokens that do not hold so many are judged wholly. Of a further one of a stranger the
/// signature is not looked at: nobody vouches for it, and its key may be as slow as they like.
inline constexpr std::size_t kMostJudgedStrangers = 64;
/// A token; and each of cryptoInfos, encryptionInfo and attributes.
inline constexpr std::size_t kMaximumPartBytes = 1U << 20U;

/// Hash values of one level of a reduced hash tree (PartialHashtree).
using HashList = std::vector<Bytes>;

/// What a digestAlgorithm names.
struct NamedHash {
  std::optional<crypto::HashAlgorithm> algorithm;  // nothing: one that is not known here
  Bytes identifier;                                // DER AlgorithmIdentifier, as it stands
  std::string name;                                // "sha256", else as OpenSSL calls it, or dotted
};
NamedHash named_hash(crypto::HashAlgorithm algorithm);

struct ArchiveTimeStamp {
  std::optional<NamedHash> digest_algorithm;  // absent: the token's
  Bytes attributes;                           // DER, implicitly tagged [1]; empty: absent
  std::vector<HashList> reduced_tree;         // empty: absent
  Bytes token;                                // ContentInfo, as it stands
};
using ArchiveTimeStampChain = std::vector<ArchiveTimeStamp>;

struct EvidenceRecord {
  std::vector<NamedHash> digest_algorithms;
  Bytes crypto_infos;     // DER, implicitly tagged [0]; empty: absent. Not looked into.
  Bytes encryption_info;  // DER, implicitly tagged [1]; likewise
  std::vector<ArchiveTimeStampChain> chains;
};

struct RecordParse {
  std::optional<EvidenceRecord> record;
  std::string explanation;  // where there is none: the place in the record, and what is wrong there
};
/// Refuses what is no DER (around the tokens, which may be BER as CMS permits), has another version, an empty
/// chain or hash list, trailing bytes, or more of anything than the limits above.
RecordParse parse_record(ByteView der);
/// Throws kiroku::Error for what parse_record() would refuse.
Bytes encode_record(const EvidenceRecord& record);
/// DER of one chain; and of an ArchiveTimeStampSequence of chains that stand one behind the other: what a
/// hash-tree renewal covers beside the data (RFC 4998 section 5.2).
Bytes encode_chain(const ArchiveTimeStampChain& chain);
Bytes sequence_of_chains(ByteView chains);

/// "archiveTimeStampSequence[1][0]": where messages say something is.
std::string place_of(std::size_t chain, std::size_t time_stamp);

}  // namespace kiroku::evidence

// What an evidence record proves (RFC 4998 sections 4.3 and 5.3): that data existed at the time of its first
// time-stamp, by a chain of time-stamps each of which was renewed while it still counted. Nothing throws for
// what a record says. Thread-safe: everything given is only read.
//
// What is demanded, of each time-stamp in turn:
//  1. its token is one that timestamp/token_verifier.h finds valid under the trusted roots, over the root of
//  its
//     reduced hash tree, hashed with the chain's own algorithm;
//  2. the first list of its tree holds the data (the first of the record), the token before it (a time-stamp
//     renewal), or the data together with all chains before (a hash-tree renewal: the hash of the data's hash
//     followed by that of the chains);
//  3. its time is not before that of the one before it;
//  4. when the next one came, or now for the newest: its certificates had not ended, and its algorithms still
//     counted by the policy. The chain's hash algorithm must have counted when the next chain began.
// Without a reduced tree a time-stamp covers one object alone. Records in XML (RFC 6283) are judged by the
// same rules; what their renewals are over differs (RenewalCover).
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "evidence/policy.h"
#include "evidence/record.h"
#include "timestamp/token_verifier.h"

namespace kiroku::evidence {

/// Something that a record is to prove.
struct DataObject {
  std::string name;
  /// Its hash; nothing where it cannot be had under this algorithm.
  std::function<std::optional<Bytes>(crypto::HashAlgorithm)> digest;
  /// Its bytes, for records in XML: those canonicalise data that is XML. Valid as long as the object; none:
  /// the hash above is taken.
  std::optional<ByteView> content = {};
};

enum class Standing {
  kHolds,
  kCouldNotCheck,  // no trusted root, or data that could not be read
  kRefused,        // the answer is no
};

/// Each code is stable and listed in docs/reference/format-evidence.md.
struct Problem {
  std::string code;
  Standing standing = Standing::kRefused;
  std::string place;  // in the record: "archiveTimeStampSequence[1][0]"
  std::string text;   // one sentence
};

enum class StampKind { kFirst, kTimeStampRenewal, kHashTreeRenewal };

/// One archive time-stamp.
struct TimeStampJudgement {
  std::size_t chain = 0, index = 0;
  StampKind kind = StampKind::kFirst;
  std::string algorithm;      // of its chain
  bool imprint_fits = false;  // its token is over the root of its tree
  /// Of a time-stamp renewal: the first list holds the time-stamp before it. Of a hash-tree renewal in XML:
  /// it holds the chains before.
  bool covers_previous = false;
  std::vector<std::size_t> objects;  // of those given, in its first list; of the first one of a chain
  std::size_t other_values = 0;      // in that list: values of nothing that was given
  timestamp::TokenJudgement token;   // under the trusted roots
};

struct RecordJudgement {
  std::vector<TimeStampJudgement> time_stamps;  // in the record's order
  std::vector<Problem> problems;
  /// Of each object: the first chain that covers it.
  std::vector<std::optional<std::size_t>> covered_from;
  /// Of each object: of some chain it is the canonical XML that is covered, and not the bytes.
  std::vector<bool> only_as_canonical;

  /// The worst of the problems.
  [[nodiscard]] Standing standing() const;
  /// Of the first and the newest time-stamp; nothing where its token could not be read.
  [[nodiscard]] std::optional<UtcTime> since() const;
  [[nodiscard]] std::optional<UtcTime> newest() const;
  /// Whether every time-stamp is an outside authority's. Otherwise the times are what the recorder says.
  [[nodiscard]] bool outside() const;
  /// When the newest time-stamp stops counting, and why, by the certificates and the policy; nothing where no
  /// end is known.
  struct End {
    UtcTime time;
    std::string of;  // "a certificate of …", "sha256"
  };
  std::optional<End> end;
  /// When the hash of the newest chain stops counting by the policy; then only a hash-tree renewal helps.
  std::optional<UtcTime> data_hash_end;
};

struct JudgingRules {
  const timestamp::TrustStore* trust = nullptr;  // null: nobody is trusted
  const Policy* policy = nullptr;                // null: Policy::without_ends()
  UtcTime now;
  /// Objects that came after the record began may be covered from a later chain on.
  bool objects_may_join = false;
};

/// What may stand for an object in a list of hashes: either value.
struct ObjectValues {
  std::optional<Bytes> bytes;      // of its bytes
  std::optional<Bytes> canonical;  // of its canonical XML
  /// It may have one more, which could not be had. In half a sentence why, where that is known.
  bool is_partial = false;
  std::string why = {};
};

/// What a renewal is over, which depends on how the record is written. Not thread-safe; asked for chains in
/// their order.
class RenewalCover {
 public:
  RenewalCover() = default;
  RenewalCover(const RenewalCover&) = delete;
  RenewalCover& operator=(const RenewalCover&) = delete;
  virtual ~RenewalCover() = default;
  /// The hash of a time-stamp, for the one that renews it.
  virtual Bytes time_stamp(std::size_t chain, std::size_t index, crypto::HashAlgorithm algorithm) = 0;
  /// The hash of all chains before this one, of which there is one at least.
  virtual Bytes chains_before(std::size_t chain, crypto::HashAlgorithm algorithm) = 0;
  /// Of an object, as this chain may hash it.
  virtual ObjectValues object(const DataObject& object, std::size_t chain,
                              crypto::HashAlgorithm algorithm) = 0;
  /// Whether a hash-tree renewal has a value for each object together with the chains before (RFC 4998
  /// section 5.2), or one for the chains and one for each object (RFC 6283 section 4.2.2).
  [[nodiscard]] virtual bool joins_objects_and_chains() const = 0;
};

RecordJudgement judge_record(const EvidenceRecord& record, const std::vector<DataObject>& objects,
                             const JudgingRules& rules);
/// Of a record that is not written as RFC 4998 says.
RecordJudgement judge_record(const EvidenceRecord& record, const std::vector<DataObject>& objects,
                             const JudgingRules& rules, RenewalCover& cover);

/// What a chain hashes with: as its first time-stamp says, else that one's token. Nothing where that is no
/// hash that counts here.
std::optional<crypto::HashAlgorithm> hash_of_chain(const ArchiveTimeStampChain& chain);

}  // namespace kiroku::evidence

// Shared tokens: one token of an authority over many objects, and what shows it for one of them. The form is
// an evidence record (RFC 4998) with a single time-stamp, by SHA-256 alone:
//
//   EvidenceRecord: version 1, { sha256 }, one chain of one time-stamp: sha256, reducedHashtree, token
//
// Its hash tree leads from the object's hash to the token's imprint. Where an object was alone in its round
// there is no tree, and the token is over the object's own hash. Beside the object's hash the first list may
// hold a nonce: 32 random bytes that whoever asked drew for this token. They show that the token is younger
// than the question, as the nonce of RFC 3161 section 2.4.2 does, and what others of the round get as a node
// tells nothing of the object. Pure functions and immutable values; thread-safe.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evidence/hash_tree.h"
#include "evidence/record.h"
#include "evidence/renewal.h"
#include "timestamp/token_verifier.h"

namespace kiroku::evidence {

/// Whether the bytes begin as an evidence record does, and not as an RFC 3161 response or a token does.
bool begins_as_record(ByteView der);

struct SharedToken {
  std::vector<HashList> path;  // the lists of the reduced hash tree; empty without one
  Bytes token;                 // ContentInfo, as it stands

  /// The imprint that the token must have to be over the object with this SHA-256; nothing where the first
  /// list does not hold it, so that the path is another object's.
  [[nodiscard]] std::optional<Bytes> imprint_for(ByteView digest) const;
  /// Whether the first list holds this value: of a nonce, whether the token is younger than its drawing.
  [[nodiscard]] bool begins_with(ByteView value) const;
};

struct SharedTokenParse {
  std::optional<SharedToken> shared;
  std::string explanation;  // where there is none: what is wrong, one sentence without its end
};
/// Takes one form alone: what share_token() would write of it, byte for byte. Refuses what parse_record()
/// refuses, several time-stamps, other hashes, and anything beside.
SharedTokenParse parse_shared_token(ByteView der);

/// One token over many groups of SHA-256 hashes, which is asked for once, and the file for each of them.
class StampedRound {
 public:
  /// A group is an object's hash, and the nonce that came with it if one did. Equal groups count once. Throws
  /// kiroku::UsageError for no group, or an empty one, and what `stamp` throws.
  StampedRound(std::vector<HashList> groups, const Stamp& stamp);
  /// The file of the group at this place among those given.
  [[nodiscard]] Bytes file_of(std::size_t group) const;

 private:
  HashTree tree_;
  Bytes token_;
};

/// What is to be judged of a file, a response, a bare token or a shared token, as a time-stamp over data.
struct StampJudging {
  Bytes token;                         // for timestamp::judge_token(), with
  timestamp::Expectation expectation;  // its imprint set: empty where the path is another object's

  /// Whether that imprint is the token's. Needs no trust.
  [[nodiscard]] bool is_over_data(const timestamp::TokenInfo& info) const;
};
/// Of a response or a token: what to judge, whatever it is.
StampJudging judging_response(ByteView response_or_token, ByteView data);
/// Of a shared token; nothing, and why, for what is none.
std::optional<StampJudging> judging_shared(ByteView record, ByteView data, std::string& explanation);

}  // namespace kiroku::evidence
